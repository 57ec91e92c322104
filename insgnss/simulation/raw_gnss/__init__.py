"""Raw GNSS observations of rover and base, as RINEX, on the exact motion."""
