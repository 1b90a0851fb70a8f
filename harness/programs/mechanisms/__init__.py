"""The equations of motion of a mechanism as programs: its kernels, derivatives, energies, and the forces of its constraints."""
