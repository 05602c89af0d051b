"""What a lab adds to rw_ekf, one module for each seam (docs/extending.md)."""
