"""Commands about forces: results of runs on forces, kinematics of wings, forces in free flight."""
