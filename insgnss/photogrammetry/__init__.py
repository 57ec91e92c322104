"""Image blocks: adjustment, mounting, targets, comparison with other poses."""
