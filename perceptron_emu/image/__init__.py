"""A room of the emulator."""
