"""Models behind six roles: backends, their composition, the journal of calls, the manifests of weights."""
