"""What a memory knows beyond texts: sensors, times, visits, changes between them, and how many things there are."""
