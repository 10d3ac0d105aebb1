"""A ROS 2 node that learns a route from the frames of a panoramic camera, and then follows it.

    python3 route_follower.py --ros-args -r image:=/camera/image_raw -r cmd_vel:=/cmd_vel

While the parameter `learning` is true, frames are collected. Setting it to false trains the model and starts the steering:

    ros2 param set /route_follower learning false

The node needs ROS 2 (rclpy) and tussock in one Python environment. The two functions that map messages need neither ROS nor a robot.
"""

import numpy as np
import torch

from tussock import Encoding, PerfectMemory
from tussock.navigation.steering import Look, Motion, Scan

CHANNELS = {"mono8": [0, 0, 0], "rgb8": [0, 1, 2], "bgr8": [2, 1, 0], "rgba8": [0, 1, 2], "bgra8": [2, 1, 0]}


def frame_of(message) -> np.ndarray:
    """The picture (height, width, 3), RGB, of a sensor_msgs/Image, whose rows may be padded."""
    if message.encoding not in CHANNELS:
        raise ValueError(f"images are {message.encoding!r}; this node takes {', '.join(CHANNELS)}")
    count = {"mono8": 1, "rgb8": 3, "bgr8": 3}.get(message.encoding, 4)
    rows = np.frombuffer(message.data, np.uint8).reshape(message.height, message.step)
    pixels = rows[:, : message.width * count].reshape(message.height, message.width, count)
    return np.ascontiguousarray(pixels[..., CHANNELS[message.encoding]])


def velocity_of(motion: Motion, speed: float, period: float, max_turn_rate: float) -> tuple[float, float]:
    """The velocities of a geometry_msgs/Twist that make a motion within one period of control.

    Args:
        motion: Of one agent.
        speed: Of a whole step (m/s).
        period: Time until the next frame (s).
        max_turn_rate: What the robot can do (rad/s).

    Returns:
        linear.x (m/s) and angular.z (rad/s, left positive, as ROS has it). While the turn takes longer than a period, the robot
        turns on the spot.
    """
    turn_rate = float(motion.turn[0]) / period
    share = 1.0 if motion.step is None else float(motion.step[0])
    if abs(turn_rate) > max_turn_rate:
        return 0.0, float(np.sign(turn_rate)) * max_turn_rate
    return speed * share, turn_rate


def main() -> None:
    import rclpy
    from geometry_msgs.msg import Twist
    from rclpy.node import Node
    from sensor_msgs.msg import Image

    class RouteFollower(Node):
        def __init__(self):
            super().__init__("route_follower")
            defaults = {"learning": True, "speed": 0.1, "period": 0.2, "max_turn_rate": 1.0}
            self.declare_parameters("", list(defaults.items()))
            self.encoding = Encoding.parse("grey | resize 6 | normalise")
            self.navigator, self.learned, self.memory = Scan(model=PerfectMemory()), [], None
            self.publisher = self.create_publisher(Twist, "cmd_vel", 1)
            self.create_subscription(Image, "image", self.look, 1)

        def look(self, message: Image) -> None:
            """Keep the frame, or steer by it. The camera's frames are panoramas; unwrap others first (docs/robot.md)."""
            views = self.encoding(frame_of(message)[None])
            if self.get_parameter("learning").value:
                self.learned.append(views)
                return
            if self.memory is None:
                self.navigator.learn(torch.cat(self.learned))
                self.memory = [self.navigator.begin()]
            motion = self.navigator.decide(Look(views=views, compass=np.zeros(1)), self.memory)
            settings = (self.get_parameter(name).value for name in ("speed", "period", "max_turn_rate"))
            twist = Twist()
            twist.linear.x, twist.angular.z = velocity_of(motion, *settings)
            self.publisher.publish(twist)

    rclpy.init()
    rclpy.spin(RouteFollower())


if __name__ == "__main__":
    main()
