"""The state after one step of an integrator, by the rule that its engine documents."""
