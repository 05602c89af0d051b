"""Plain functions of Python printed as C99: what flies, and what is compiled for passes over logs."""
