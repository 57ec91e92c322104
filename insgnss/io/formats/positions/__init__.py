"""Camera positions without attitude: the product of PPK alone, and what bundle adjustments read."""
