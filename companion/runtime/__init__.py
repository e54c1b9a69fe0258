"""The pipeline and its drivers: flight (real time) and lockstep (virtual time)."""
