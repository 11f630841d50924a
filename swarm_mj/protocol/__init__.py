"""The protocol (II-B, II-C, III-B): buffers, the communication window, and what it costs."""
