"""Virtual experiments that write datasets: the wing campaign of the thesis, and the balance of the DelFly."""
