"""The live loop: on time, within its limits, observable."""
