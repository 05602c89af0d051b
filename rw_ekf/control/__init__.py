"""What current is requested: profiles, a recorded current; compensation comes here."""
