"""Steered figures: a stick, words or a script become a pose a tick, for one figure or thousands.

    command (gait, velocity, facing; a point to go to)
      -> session.py: within what the gaits allow (gaits.py), along paths (paths.py), around others (avoidance.py)
      -> matching.py: the recorded row that fits is searched
      -> step.py: the row is played, warped (warping.py) and smoothed, and the root moved
      -> layers over that pose: action_layer.py, idle.py, foot_lock.py (stepping.py), terrain.py, look_layer.py,
         reach_layer.py, turn_limit.py
      -> Pose (pose.py) with what happened (events.py)

Main names: SteerModel (model.py), SteerSession (session.py), Matcher (matching.py), tick (step.py), Pose (pose.py).
Numbers: SteeringSettings (settings.py), FootLockSettings (foot_lock.py), ActSettings (acts.py), each in the bundle's
manifest; those of the other layers stand at the head of their files.
"""
