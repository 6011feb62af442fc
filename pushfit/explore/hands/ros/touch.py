r"""Touch node: a sensor of whatever kind as one stream of forces.

    python -m pushfit.explore.hands.ros.touch _source:=finger/wrench
    python -m pushfit.explore.hands.ros.touch \
        _source:=tip _type:=std_msgs/Int32 _field:=data

Of a wrench the force is passed on; of another message a named field becomes the normal
force. A message without a stamp of its own gets the time at which it came. Excluded:
faults of the stream (`pushfit.explore.hands.touch`).
"""

from functools import partial, reduce
from importlib import import_module

from pushfit.explore.hands.ros import messages
from pushfit.explore.hands.ros.messages import ros


class TouchNode:
    """ROS 1 node that hands on what a sensor measures as the stream of touch."""

    def __init__(self) -> None:
        """Connect the sensor to the stream."""
        r = ros()
        rospy = r.rospy
        source = rospy.get_param("~source", messages.WRENCH)
        package, name = rospy.get_param("~type", "geometry_msgs/WrenchStamped").split(
            "/"
        )
        kind = getattr(import_module(f"{package}.msg"), name)
        self.field = rospy.get_param("~field", "")
        self._stream = rospy.Publisher(
            messages.TOUCH, r.geometry_msgs.WrenchStamped, queue_size=100
        )
        rospy.Subscriber(source, kind, self._on_sample, queue_size=1000)

    def _on_sample(self, message: object) -> None:
        r = ros()
        sample = r.geometry_msgs.WrenchStamped()
        header = getattr(message, "header", None)
        sample.header.stamp = r.rospy.Time.now()
        if header is not None and not header.stamp.is_zero():
            sample.header.stamp = header.stamp
        if self.field:
            value = reduce(getattr, self.field.split("."), message)
            sample.wrench.force.z = float(value)  # pyright: ignore
        else:
            sample.wrench = message.wrench  # pyright: ignore
        self._stream.publish(sample)


main = partial(messages.run, "pushfit_touch", TouchNode)

if __name__ == "__main__":
    main()
