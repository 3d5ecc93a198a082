def sensors(self):
    return [
        {'type': 'sensor.camera.rgb', 'x': 0.7, 'id': 'Left'},  # a camera
        {'type': 'sensor.lidar.ray_cast', 'x': 0.6, 'y': 0.4, 'z': 2.8, 'roll': -17.2, 'pitch': -5.7, 'yaw': 28.6, 'id': 'LIDAR',
         'channels': 16, 'upper_fov': 15, 'lower_fov': -15},
    ]
