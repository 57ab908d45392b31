"""What is measured, with the figures of the last run beside each script."""
