from launch import LaunchDescription
def generate_launch_description():
    return LaunchDescription([
        Node(package='tf2_ros', executable='static_transform_publisher', # a comment
             arguments=['--x', '1', '--y', '0.5', '--z', '2', '--roll', '-0.3', '--frame-id', 'base_link', '--child-frame-id', "lidar_0"]),
        Node(executable="static_transform_publisher", arguments=[1, 2.5, '-3', 0, .1, 0, 'lidar_0', 'lidar_1']),
    ])
