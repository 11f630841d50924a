// What ns-3 says of scenes that ns3.py hands it, line by line: who decodes whom, and at what power.
//
// A scene is one slot: robots at rest, of which some send at once. ns-3 brings the propagation, the
// half-duplex radio, the interference of concurrent signals and the error model (Shannon's bound);
// nothing of the arithmetic of a reception stands here.
//
//   radio POWER_W NOISE_W THRESHOLD HZ FADES LAW [NUMBERS]  the radio of all robots from here on
//   scene N SENDERS.. X Y Z ..                              N marks, 1 of a sender; then all places
//   moves FILE N TIMES..                                    where a trace has N robots at times [s]

#include "ns3/core-module.h"
#include "ns3/mobility-module.h"
#include "ns3/network-module.h"
#include "ns3/propagation-module.h"
#include "ns3/spectrum-module.h"

#include <cmath>
#include <iostream>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

using namespace ns3;

namespace
{

constexpr double BAND_HZ = 1e6;
constexpr uint32_t PACKET_BYTES = 1000000; // large, so that counting in whole bytes costs nothing

struct Radio
{
    double powerW, noiseW, threshold, hz;
    Ptr<PropagationLossModel> law;
};

struct Scene
{
    std::vector<bool> sends;
    std::vector<Ptr<MobilityModel>> place;
};

double
ToDbm(double watts)
{
    return 10.0 * std::log10(watts * 1e3);
}

Ptr<PropagationLossModel>
FreeSpace(double hz)
{
    auto friis = CreateObject<FriisPropagationLossModel>();
    friis->SetFrequency(hz);
    return friis;
}

// The law by its name, with its numbers. Both logarithmic laws begin with what Friis leaves over 1 m.
Ptr<PropagationLossModel>
ReadLaw(std::istream& line, double hz)
{
    std::string name;
    line >> name;
    if (name == "free-space")
    {
        return FreeSpace(hz);
    }
    if (name == "two-ray")
    {
        double height;
        line >> height;
        auto law = CreateObject<TwoRayGroundPropagationLossModel>();
        law->SetFrequency(hz);
        law->SetHeightAboveZ(height);
        return law;
    }
    NS_ABORT_MSG_IF(name != "log-distance", "no law " << name);
    double reference, exponent;
    line >> reference >> exponent;
    auto here = CreateObject<ConstantPositionMobilityModel>();
    auto there = CreateObject<ConstantPositionMobilityModel>();
    there->SetPosition(Vector(1.0, 0.0, 0.0));
    double lossDb = -FreeSpace(hz)->CalcRxPower(0.0, here, there);
    if (reference == 1.0)
    {
        auto law = CreateObject<LogDistancePropagationLossModel>();
        law->SetReference(1.0, lossDb);
        law->SetPathLossExponent(exponent);
        return law;
    }
    auto law = CreateObject<ThreeLogDistancePropagationLossModel>();
    law->SetAttribute("Distance0", DoubleValue(1.0));
    law->SetAttribute("Distance1", DoubleValue(reference));
    law->SetAttribute("Distance2", DoubleValue(1e9));
    law->SetAttribute("Exponent0", DoubleValue(2.0));
    law->SetAttribute("Exponent1", DoubleValue(exponent));
    law->SetAttribute("ReferenceLoss", DoubleValue(lossDb));
    return law;
}

Radio
ReadRadio(std::istream& line)
{
    Radio radio;
    bool fades;
    line >> radio.powerW >> radio.noiseW >> radio.threshold >> radio.hz >> fades;
    radio.law = ReadLaw(line, radio.hz);
    if (fades)
    {
        auto rayleigh = CreateObject<NakagamiPropagationLossModel>();
        for (const char* m : {"m0", "m1", "m2"}) // of near, middle and far distances
        {
            rayleigh->SetAttribute(m, DoubleValue(1.0));
        }
        radio.law->SetNext(rayleigh);
    }
    return radio;
}

Scene
ReadScene(std::istream& line)
{
    int num;
    line >> num;
    Scene scene;
    for (int i = 0; i < num; i++)
    {
        int sends;
        line >> sends;
        scene.sends.push_back(sends != 0);
    }
    for (int i = 0; i < num; i++)
    {
        double x, y, z;
        line >> x >> y >> z;
        auto place = CreateObject<ConstantPositionMobilityModel>();
        place->SetPosition(Vector(x, y, z));
        scene.place.push_back(place);
    }
    NS_ABORT_MSG_IF(line.fail(), "a scene ends too early");
    return scene;
}

// Who decodes `first`, when it and all that send transmit at once; `silent` does not, if it is one.
std::vector<bool>
Decodes(const Radio& radio, const Scene& scene, size_t first, size_t silent)
{
    BandInfo band;
    band.fc = radio.hz;
    band.fl = radio.hz - BAND_HZ / 2;
    band.fh = radio.hz + BAND_HZ / 2;
    auto spectrum = Create<SpectrumModel>(Bands{band});
    auto sent = Create<SpectrumValue>(spectrum);
    auto noise = Create<SpectrumValue>(spectrum);
    (*sent)[0] = radio.powerW / BAND_HZ;
    (*noise)[0] = radio.noiseW / BAND_HZ;
    auto channel = CreateObject<SingleModelSpectrumChannel>();
    channel->AddPropagationLossModel(radio.law);
    std::vector<bool> decodes(scene.place.size(), false);
    std::vector<Ptr<HalfDuplexIdealPhy>> phys;
    for (size_t j = 0; j < scene.place.size(); j++)
    {
        auto phy = CreateObject<HalfDuplexIdealPhy>();
        phy->SetMobility(scene.place[j]);
        phy->SetChannel(channel);
        phy->SetTxPowerSpectralDensity(sent);
        phy->SetNoisePowerSpectralDensity(noise);
        // By Shannon's bound this rate needs exactly the threshold.
        phy->SetRate(DataRate(uint64_t(BAND_HZ * std::log2(1.0 + radio.threshold))));
        phy->SetGenericPhyRxEndOkCallback(
            Callback<void, Ptr<Packet>>([&decodes, j](Ptr<Packet> packet) {
                decodes[j] = decodes[j] || packet->GetSize() == PACKET_BYTES;
            }));
        channel->AddRx(phy);
        phys.push_back(phy);
    }
    // A receiver locks on to what comes first: the others come a nanosecond later.
    Simulator::Schedule(Seconds(0), [&] { phys[first]->StartTx(Create<Packet>(PACKET_BYTES)); });
    for (size_t i = 0; i < phys.size(); i++)
    {
        if (scene.sends[i] && i != first && i != silent)
        {
            Simulator::Schedule(NanoSeconds(1),
                                [&, i] { phys[i]->StartTx(Create<Packet>(PACKET_BYTES - 1)); });
        }
    }
    Simulator::Run();
    Simulator::Destroy();
    return decodes;
}

// Three lines for each sender: who decodes it; who would, if it were silent itself; and the power
// at everyone [mW].
void
WriteScene(const Radio& radio, const Scene& scene)
{
    const size_t num = scene.sends.size();
    for (size_t i = 0; i < num; i++)
    {
        if (!scene.sends[i])
        {
            continue;
        }
        auto decodes = Decodes(radio, scene, i, num);
        for (bool each : decodes)
        {
            std::cout << each << ' ';
        }
        std::cout << '\n';
        for (size_t j = 0; j < num; j++)
        {
            bool lifted = decodes[j];
            if (scene.sends[j])
            {
                lifted = i != j && Decodes(radio, scene, i, j)[j];
            }
            std::cout << lifted << ' ';
        }
        std::cout << '\n';
        for (size_t j = 0; j < num; j++)
        {
            double dbm = radio.law->CalcRxPower(ToDbm(radio.powerW), scene.place[i], scene.place[j]);
            std::cout << (i == j ? 0.0 : std::pow(10.0, dbm / 10.0)) << ' ';
        }
        std::cout << '\n';
    }
}

// A line for each time, of all robots' positions [m].
void
WriteMoves(std::istream& line)
{
    std::string file;
    int num;
    line >> file >> num;
    NodeContainer robots;
    robots.Create(num);
    Ns2MobilityHelper(file).Install();
    for (double time; line >> time;)
    {
        Simulator::Schedule(Seconds(time), [robots] {
            for (auto robot = robots.Begin(); robot != robots.End(); ++robot)
            {
                auto place = (*robot)->GetObject<MobilityModel>()->GetPosition();
                std::cout << place.x << ' ' << place.y << ' ' << place.z << ' ';
            }
            std::cout << '\n';
        });
    }
    Simulator::Run();
    Simulator::Destroy();
}

} // namespace

int
main()
{
    RngSeedManager::SetSeed(1); // of the fades, of which every call draws new ones
    std::cout.precision(std::numeric_limits<double>::max_digits10);
    Radio radio;
    for (std::string text; std::getline(std::cin, text);)
    {
        std::istringstream line(text);
        std::string word;
        line >> word;
        if (word == "radio")
        {
            radio = ReadRadio(line);
        }
        else if (word == "scene")
        {
            WriteScene(radio, ReadScene(line));
        }
        else if (word == "moves")
        {
            WriteMoves(line);
        }
    }
    return 0;
}
