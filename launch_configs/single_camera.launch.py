"""One camera, one laser: `ros2 launch laser_profiler single_camera.launch.py image_topic:=/camera/image_raw`.

For the turntable use another parameter file: params_file:=$(ros2 pkg prefix --share laser_profiler)/config/turntable.yaml.
For a binary outside of any ROS package: executable:=/usr/local/bin/laser_profiler params_file:=/etc/laser_profiler/cell.yaml.
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
                [FindPackageShare('laser_profiler'), 'config', 'cell.yaml']),
            description='ROS 2 parameter file of the node'),
        DeclareLaunchArgument(
            'image_topic', default_value='/camera/image_raw',
            description='Images of the camera; when the parameters say image_transport: compressed, '
                        'this name with /compressed behind it'),
        DeclareLaunchArgument(
            'camera_info_topic', default_value='/camera/camera_info',
            description='Calibration of the camera, beside its images'),
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
                ('image_raw', LaunchConfiguration('image_topic')),
                ('camera_info', LaunchConfiguration('camera_info_topic')),
            ],
            output='screen'),
    ])
