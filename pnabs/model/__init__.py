"""Networks, losses, training steps and prediction: torch only, no Ray, no run folder."""
