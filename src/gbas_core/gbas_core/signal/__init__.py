"""What happens to a signal on its way into a receiver: antenna, link budget, reflections, tracking loops."""
