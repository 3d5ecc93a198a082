//! The formats that hold a rig.

/// A format that holds a rig.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum RigFormat {
    /// Autoware's pair of YAML files; metres, radians.
    Autoware,
    /// URDF; metres, radians.
    Urdf,
    /// SDF, as Gazebo reads it; metres, radians.
    Sdf,
    /// A ROS 2 launch file of static transform publishers; metres, radians.
    Ros2Launch,
    /// The list that `sensors()` of a CARLA agent returns; left-handed, degrees.
    Carla,
    /// `objects.json` of the CARLA ROS bridge; degrees.
    CarlaObjects,
    /// Static transforms as `ros2 topic echo /tf_static` prints them; metres, quaternions; read only.
    Tf,
    /// PandaSet's extrinsics; read only.
    Pandaset,
    /// Placements of this program.
    Json,
}

impl RigFormat {
    /// Every format.
    pub const ALL: [Self; 9] = [
        Self::Autoware,
        Self::Urdf,
        Self::Sdf,
        Self::Ros2Launch,
        Self::Carla,
        Self::CarlaObjects,
        Self::Tf,
        Self::Pandaset,
        Self::Json,
    ];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Autoware => "autoware",
            Self::Urdf => "urdf",
            Self::Sdf => "sdf",
            Self::Ros2Launch => "ros2-launch",
            Self::Carla => "carla",
            Self::CarlaObjects => "carla-objects",
            Self::Tf => "tf",
            Self::Pandaset => "pandaset",
            Self::Json => "json",
        }
    }

    /// True if a frame of this format is the foot of its sensor; else it is the optical centre.
    pub fn holds_feet(self) -> bool {
        matches!(self, Self::Autoware | Self::Urdf | Self::Sdf | Self::Ros2Launch | Self::Tf)
    }
}
