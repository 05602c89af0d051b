"""What current is asked for: profiles, a recorded current; compensation comes here."""
