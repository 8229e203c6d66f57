"""The only HTTP: server, schemas, security, routes, streams."""
