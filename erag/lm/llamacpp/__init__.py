"""GGUF models through llama.cpp: tried in a child process, then many sequences at once."""
