"""The simulated six-axis arm with a loop over all of its joints, for tests."""

from backdrive.control import ArmJoint, ArmLoop, JointLoop, torque_limit
from backdrive.control.compensators import alg_fc, nothing
from backdrive.control.estimators.external import ExternalForce
from backdrive.control.estimators.friction import alg_fe
from backdrive.logs.log import Joint
from backdrive.model import ArmModel, Estimate, FrictionModel, JointFriction, Validity
from backdrive.plans.limits import JointLimits
from backdrive.robot import parse_robot
from backdrive.simulation.arm import hp3j, mjcf

T, TOP = 1e-3, 3.0


def six_axis():
    """Return the rigid bodies of the simulated arm."""
    return parse_robot(mjcf())


def arm_joints(share=0.8, limits=(-2.5, 2.5), **changes):
    """Return what runs on the joints of the simulated arm, whose friction is known."""
    joints = {}
    for own in hp3j():
        rate, K = own.law.rate, 0.5 * own.stiffness
        compensator = alg_fc(rate, K, share=share) if share else nothing()
        loop = JointLoop(
            compensator=compensator,
            external=ExternalForce(inertia=own.inertia, friction=alg_fe(rate, K), method="momentum"),
            limit=torque_limit(compensator, TOP),
            top_speed=TOP,
            encoder_count=own.encoder_count,
        )
        ends = JointLimits(name=own.name, lower=limits[0], upper=limits[1], effort=own.torque_limit)
        joints[own.name] = ArmJoint(loop=loop, limits=ends, inertia=own.motor_inertia, **changes)
    return joints


def arm_loop(share=0.8, limits=(-2.5, 2.5), changes=None, **settings):
    """Return a loop of the simulated arm."""
    return ArmLoop(six_axis(), arm_joints(share, limits, **(changes or {})), interval=T, **settings)


def arm_model():
    """Return the simulated arm as it would be identified without an error."""
    robot, frictions = six_axis(), []
    for own in hp3j():
        dynamics = {
            "inertia": Estimate(value=own.motor_inertia, unit="kg.m^2"),
            "offset": Estimate(value=0.0, unit="N.m"),
            "transition": Estimate(value=2e-3, unit="rad/s"),
        }
        joint = Joint(name=own.name, encoder_counts=1.0 / own.encoder_count)
        validity = Validity(velocity=(-2.4, 2.4))
        frictions.append(JointFriction(joint=joint, law=own.law, validity=validity, dynamics=dynamics))
    arm = ArmModel(urdf_sha256=robot.sha256, parameters=tuple(robot.parameters), condition=10.0)
    return FrictionModel(joints=tuple(frictions), arm=arm)


def arm_limits(effort=None):
    """Return limits of the simulated arm, which its description does not state."""
    return {
        own.name: JointLimits(
            name=own.name, lower=-2.5, upper=2.5, velocity=TOP, effort=effort or own.torque_limit
        )
        for own in hp3j()
    }
