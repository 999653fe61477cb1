"""Any OpenAI-compatible endpoint as a backend, and a server that offers any local backend under the same protocol."""
