"""Commands about forces: results of force runs, kinematics, free flight."""
