"""What the emulator is made of."""
