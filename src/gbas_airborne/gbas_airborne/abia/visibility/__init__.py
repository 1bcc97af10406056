"""What an aircraft sees of the satellites along its flight, how good their geometry is, and how good it must be."""
