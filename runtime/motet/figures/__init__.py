"""Human figures: any skeleton to the humanoid and back, its feet and its legs.

    motion of any figure -> joint map -> rest pose measured -> the humanoid (humanoid/) and back
    positions of feet -> which stand (feet/contacts.py) -> held in place (feet/hold.py), or the path that they lay for
    the root (feet/contacts.py, feet/treadmill.py)

legs.py and two_bones.py are the inverse kinematics of limbs; root_motion.py the path over the ground; floor.py bodies
that lie or kneel.

Main names: HUMANOID, to_humanoid, from_humanoid and Figure (humanoid/), contacts_of (feet/contacts.py), TwoBones
(two_bones.py).
Numbers: ContactSettings (feet/contacts.py), HoldSettings (feet/hold.py), TreadmillSettings (feet/treadmill.py).
"""
