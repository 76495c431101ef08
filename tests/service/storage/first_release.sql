-- Rows of a database of the first release (schema 0001): a finished run on tracks, and one half-way. The toy search's.
insert into dataset (id, name, description, filename, created_at, sha256, size_bytes, markers, recordings)
  values ('ds_1', 'toy', '', 'toy.zip', '2026-11-05T09:30:00.000000Z', 'abc', 3, 2, '[{"name": "slow", "rig": "vacuum_chamber", "held_out": false, "frames": 4, "markers": 2, "missing_percent": 12.5, "flap_frequency_hz": 3.0, "phase_lag_deg": 45.0, "pressure_mbar": 100.0, "temperature_c": 20.0, "airspeed_m_s": 0.0, "angle_of_attack_deg": 0.0}]');
insert into archive
  values ('ds_1', '{"name": "toy", "recordings": ["slow", "fast", "unseen"], "held_out": ["unseen"], "pad": ""}');
insert into run (id, name, dataset_id, spec, state, wish, progress, created_at, started_at, finished_at, generations, evaluations, elapsed_seconds, best_mm, genome, result)
  values ('run_1', 'old', 'ds_1', '{"division": "11", "mode": "staged", "population": 50, "stall": 10, "tolerance": 0.001, "max_generations": 5, "seed": 4, "bounds_factor": 5.0, "accuracy": 0.0001, "recordings": [], "genes": [], "fixed": {}}', 'SUCCEEDED', 'NONE', 1.0, '2026-11-05T09:30:00.000000Z', '2026-11-05T09:30:00.000000Z', '2026-11-05T09:30:00.000000Z', 1, 50, 1.0, 1.5, '{}', '{"before_mm": 2.0, "after_mm": 1.5, "held_out_before_mm": null, "held_out_after_mm": null, "noise_mm": null, "remarks": [], "recordings": [], "genes": []}');
insert into generation
  values ('run_1', 1, 'structural', 0, 1e-6, 1e-5, 0.1, 1.5, 50, 0, '[]', 1.0, 1.0, null);
insert into run (id, name, dataset_id, spec, state, wish, progress, created_at, started_at, generations, evaluations, elapsed_seconds, best_mm, genome)
  values ('run_2', 'half-way', 'ds_1', '{"division": "11", "mode": "staged", "population": 50, "stall": 10, "tolerance": 0.001, "max_generations": 5, "seed": 4, "bounds_factor": 5.0, "accuracy": 0.0001, "recordings": [], "genes": [], "fixed": {}}', 'RUNNING', 'NONE', 0.6, '2026-11-05T09:30:00.000000Z', '2026-11-05T09:30:00.000000Z', 6, 300, 1.0, 1.5, '{"stiffness": 1.0, "damping": 0.1}');
insert into checkpoint
  values ('run_2', '{"done": 6, "genome": {"stiffness": 1.0, "damping": 0.1}}');
