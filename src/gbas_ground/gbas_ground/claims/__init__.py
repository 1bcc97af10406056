"""What the broadcast claims, what each claim rests on, and what is refused."""
