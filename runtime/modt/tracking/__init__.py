"""Following every proposal: EKF, association, state machines."""
