"""Text tables: their layout, columns, headers, units and order; byte kernels that parse them."""
