"""What one robot's network sees (III-A): its own buffer as a graph."""
