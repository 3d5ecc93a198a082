//! SDF worlds of several models, and names with prefixes.

use super::{read, source};
use crate::rig::{FormatError, ImportSettings, ImportedRig, import_texts};

/// A model with a LiDAR 0.5 m above its link, which is 1 m along x.
fn robot(name: &str, pose: &str) -> String {
    format!(
        "<model name='{name}'><pose>{pose}</pose><link name='body'><pose>1 0 0 0 0 0</pose>\
         <sensor name='s' type='gpu_lidar'><pose>0 0 0.5 0 0 0</pose></sensor></link></model>"
    )
}

fn world(models: &str) -> String {
    let ground = "<model name='ground_plane'><static>true</static><link name='link'/></model>";
    let state =
        "<state world_name='w'><model name='robot'><pose>9 9 9 0 0 0</pose></model></state>";
    format!("<sdf version='1.6'><world name='w'>{ground}{models}{state}</world></sdf>")
}

fn with_base(text: &str, base: &str) -> Result<ImportedRig, FormatError> {
    let base_frame = Some(base.to_owned());
    import_texts(&[source("file", text)], &ImportSettings { base_frame, ..Default::default() })
}

fn position(rig: &ImportedRig) -> [f64; 3] {
    let [x, y, z, ..] = rig.rig.lidars[0].pose.values();
    [x, y, z]
}

#[test]
fn the_model_with_lidars_is_read_in_its_own_frame() {
    let rig = read(&world(&robot("robot", "4 0 0.25 0 0 3.14"))).unwrap();
    assert_eq!((position(&rig), rig.rig.name.as_str()), ([1.0, 0.0, 0.5], "robot"));
    let told = |part: &str| rig.notes.iter().any(|note| note.text().contains(part));
    assert!(told("`robot` is read; left out are ground_plane"), "{:?}", rig.notes);
    assert!(told("--base-link=0,0,0.25 counts heights"), "{:?}", rig.notes);
    assert!(rig.notes.iter().all(|note| !note.is_doubt()), "{:?}", rig.notes);
}

#[test]
fn one_of_several_models_is_picked_by_the_base_frame() {
    let text = world(&(robot("one", "0 0 0 0 0 0") + &robot("two", "0 0 0 0 0 0")));
    let message = read(&text).unwrap_err().to_string();
    let wanted =
        "file: several of its models have LiDARs: `one`, `two`; pick one with --base-frame one";
    assert_eq!(message, wanted);
    let two = with_base(&text, "two").unwrap();
    assert_eq!((position(&two), two.rig.name.as_str()), ([1.0, 0.0, 0.5], "two"));
    assert_eq!(position(&with_base(&text, "two::body").unwrap()), [0.0, 0.0, 0.5]);
    assert!(with_base(&text, "two::head").is_err());
}

#[test]
fn included_models_are_named() {
    let include = "<include><uri>model://van</uri></include>";
    let message = read(&world(include)).unwrap_err().to_string();
    assert!(message.contains("not read: `<include> of model://van`; merge"), "{message}");
    let rig = read(&world(&(include.to_owned() + &robot("robot", "0 0 0 0 0 0")))).unwrap();
    assert!(rig.notes.iter().any(|note| note.text().contains("<include> of model://van")));
    // Without sensors, the names of links tell.
    let named = "<model name='cart'><link name='velodyne'><pose>0 0 2 0 0 0</pose></link></model>";
    assert_eq!(position(&read(&world(named)).unwrap()), [0.0, 0.0, 2.0]);
}

/// `<drake:joint>` is no joint, and a prefix needs no declaration, as in the simulators.
#[test]
fn names_with_prefixes_are_other_names() {
    let sensor =
        "<my:sensor name='t' type='gpu_lidar'/><sensor name='s' type='gpu_lidar' my:word='1'/>";
    let text = format!(
        "<sdf version='1.9'><model name='m' my:a='b'><link name='l'><pose my:b='c'>1 0 0 0 0 0</pose>{sensor}\
         </link><my:joint name='j'/></model></sdf>"
    );
    let rig = read(&text).unwrap();
    assert_eq!((rig.rig.lidars.len(), position(&rig)), (1, [1.0, 0.0, 0.0]));
    let declared = text.replace("<sdf", "<sdf xmlns:my='urn:my'");
    assert_eq!(read(&declared).unwrap().rig, rig.rig);
    let joint = |origin: &str| {
        format!(
            "<robot name='r'><joint name='j' type='fixed'><origin xyz='0 0 2'{origin}/><parent link='base_link'/>\
             <child link='lidar'/><drake:screw/></joint><drake:joint name='k'/></robot>"
        )
    };
    for text in
        [joint(""), joint(" a:b='c'"), joint("").replace("<robot", "<robot xmlns:drake='u'")]
    {
        let rig = read(&text).unwrap();
        assert_eq!(position(&rig), [0.0, 0.0, 2.0]);
        assert!(rig.notes.iter().all(|note| !note.is_doubt()), "{:?}", rig.notes);
    }
}

/// Gazebo's older models call a joint as they call its link; since version 1.7 both are frames.
#[test]
fn a_joint_may_have_its_links_name_before_1_7() {
    let of = |version: &str| {
        read(&format!(
            "<sdf version='{version}'><model name='m'><link name='body'/><link name='hokuyo'><pose>1 0 0.5 0 0 0</pose>\
             <sensor name='s' type='ray'/></link><joint name='hokuyo' type='fixed'><child>hokuyo</child><parent>body</parent></joint>\
             </model></sdf>"
        ))
    };
    for before in ["1.4", "1.6"] {
        assert_eq!(position(&of(before).unwrap()), [1.0, 0.0, 0.5], "{before}");
    }
    for since in ["1.7", "1.10"] {
        assert_holds!(of(since).unwrap_err(), "hokuyo");
    }
}
