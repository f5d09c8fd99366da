"""Two cameras in one process: `ros2 launch laser_profiler two_cameras.launch.py left_image_topic:=/left/image_raw`.

The names left and right are those of `cameras` in the parameter file.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import ExecutableInPackage, FindPackageShare


def generate_launch_description():
    return LaunchDescription([
        DeclareLaunchArgument(
            'params_file',
            default_value=PathJoinSubstitution(
                [FindPackageShare('laser_profiler'), 'config', 'two_cameras.yaml']),
            description='ROS 2 parameter file of the node'),
        DeclareLaunchArgument(
            'left_image_topic', default_value='/left/image_raw',
            description='Images of the left camera'),
        DeclareLaunchArgument(
            'left_camera_info_topic', default_value='/left/camera_info',
            description='Calibration of the left camera, beside its images'),
        DeclareLaunchArgument(
            'right_image_topic', default_value='/right/image_raw',
            description='Images of the right camera'),
        DeclareLaunchArgument(
            'right_camera_info_topic', default_value='/right/camera_info',
            description='Calibration of the right camera, beside its images'),
        DeclareLaunchArgument(
            'namespace', default_value='', description='Namespace of the node'),
        DeclareLaunchArgument(
            'transport', default_value='dds', choices=['dds', 'zenoh'],
            description='zenoh where the other nodes run rmw_zenoh_cpp, dds for every other RMW'),
        DeclareLaunchArgument(
            'executable',
            default_value=ExecutableInPackage(
                executable='laser_profiler', package='laser_profiler'),
            description='Path of the binary'),
        Node(
            executable=LaunchConfiguration('executable'),
            name='laser_profiler',
            namespace=LaunchConfiguration('namespace'),
            arguments=['run', '--transport', LaunchConfiguration('transport')],
            parameters=[LaunchConfiguration('params_file')],
            remappings=[
                ('left/image_raw', LaunchConfiguration('left_image_topic')),
                ('left/camera_info', LaunchConfiguration('left_camera_info_topic')),
                ('right/image_raw', LaunchConfiguration('right_image_topic')),
                ('right/camera_info', LaunchConfiguration('right_camera_info_topic')),
            ],
            output='screen'),
    ])
