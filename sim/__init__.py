"""Wing + genome + condition -> observation."""
