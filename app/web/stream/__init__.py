"""What the page is told as it happens, over a WebSocket."""
