"""The REST and WebSocket interface, one router per resource."""
