"""What is lost by one backend against another: measured role by role, on the same items."""
