//! Parts of OpenDRIVE maps: heights, sides of the road, objects, signals, and numbers that are none.

use super::*;
use crate::network::{Network, class};
use crate::{import_opendrive, opendrive};

/// A straight road of 200 m along x with walks of 2 m; `walk` stands in the lanes of the walks, `beside` in those
/// between walk and driving lane, `more` after the lanes.
fn road(rule: &str, walk: &str, beside: &str, more: &str) -> String {
    let width = |a: f64| format!(r#"<width sOffset="0" a="{a}" b="0" c="0" d="0"/>"#);
    let lane = |id: i32, kind: &str, inside: &str| {
        format!(r#"<lane id="{id}" type="{kind}" level="false">{inside}</lane>"#)
    };
    let side = |sign: i32| {
        let mut lanes = vec![lane(sign, "driving", &width(3.5))];
        if !beside.is_empty() {
            lanes.push(lane(2 * sign, beside, &width(2.5)));
        }
        let id = (lanes.len() as i32 + 1) * sign;
        lanes.push(lane(id, "sidewalk", &format!("{}{walk}", width(2.0))));
        if sign > 0 {
            lanes.reverse();
        }
        lanes.concat()
    };
    format!(
        r#"<OpenDRIVE><header revMajor="1" revMinor="6"/><road id="1" length="200" junction="-1" rule="{rule}">
        <planView><geometry s="0" x="0" y="0" hdg="0" length="200"><line/></geometry></planView>
        <lanes><laneSection s="0"><left>{}</left><center><lane id="0" type="none" level="false"/></center>
        <right>{}</right></laneSection></lanes>{more}</road></OpenDRIVE>"#,
        side(1),
        side(-1)
    )
}

fn network(text: &str) -> Network {
    opendrive::network(text, "m.xodr").unwrap()
}

#[test]
fn a_walk_stands_as_high_as_the_map_says_on_both_sides() {
    let height = |inner: f64, outer: f64| {
        format!(r#"<height sOffset="0" inner="{inner}" outer="{outer}"/>"#)
    };
    for (walk, inner, outer) in [
        (String::new(), 0.13, 0.13),
        (height(0.0, 0.0), 0.0, 0.0),
        (height(0.3, 0.3), 0.3, 0.3),
        (height(0.1, 0.3), 0.1, 0.3),
    ] {
        let network = network(&road("RHT", &walk, "", ""));
        let walks = network.strips.iter().filter(|s| s.used == crate::network::StripUse::Walk);
        let edges: Vec<(DVec3, DVec3)> =
            walks.flat_map(|s| s.left.iter().copied().zip(s.right.iter().copied())).collect();
        assert!(edges.len() >= 4);
        for point in edges.iter().flat_map(|(l, r)| [l, r]) {
            let expected = if point.y.abs() < 4.5 { inner } else { outer };
            assert!((point.z - expected).abs() < 0.02, "{inner} {outer}: {point}");
        }
    }
}

/// Place and heading of every actor of a kind in the first frame.
fn actors(world: &GeneratedWorld, kind: &str) -> Vec<(DVec2, DVec2)> {
    let people = &world.people;
    let of_kind = people.actors.iter().filter(|a| people.models[a.model].kind == kind);
    let stand = of_kind.map(|a| people.scene.tracks[a.track].stand(0));
    stand.map(|s| (s.at.truncate(), DVec2::from_angle(s.yaw))).collect()
}

#[test]
fn bicycles_parked_cars_and_signs_keep_to_the_side_of_the_road() {
    for (rule, left) in [("RHT", 1.0), ("LHT", -1.0)] {
        let (mut bicycles, mut parked, mut signs) = (0, [0; 2], [0; 2]);
        for seed in 1..5 {
            let world = import_opendrive(&road(rule, "", "", ""), "m.xodr", seed, 2).unwrap();
            for (at, ahead) in actors(&world, "bicycle").iter().filter(|(at, _)| at.y.abs() < 3.5) {
                bicycles += 1;
                assert!((at.y.abs() - 2.8).abs() < 0.05, "{rule}: {at}");
                assert!(at.y * ahead.x * left < 0.0, "{rule}: {at}, {ahead}");
            }
            for (board, post) in boards(&world) {
                // A board stands before its post, as one who comes along sees it.
                let sound = (board.x - post.x) * post.y * left < 0.0;
                signs[usize::from(sound)] += 1;
            }
            let text = road(rule, "", "parking", "");
            let world = import_opendrive(&text, "m.xodr", seed, 2).unwrap();
            for (at, ahead) in actors(&world, "car").iter().filter(|(at, _)| at.y.abs() > 4.0) {
                parked[usize::from(at.y * ahead.x * left < 0.0)] += 1;
            }
        }
        assert!(bicycles > 0, "{rule}");
        assert!(parked[1] > 10 && parked[1] > 3 * parked[0], "{rule}: {parked:?}");
        assert!(signs[1] > 2 && signs[0] == 0, "{rule}: {signs:?}");
    }
}

/// Middle of the corners of each sign's board, and of the post that is nearest.
fn boards(world: &GeneratedWorld) -> Vec<(DVec2, DVec2)> {
    let middles = |wanted: u16| {
        let faces = (0..world.mesh().faces.len()).filter(|f| world.mesh().face_class[*f] == wanted);
        faces.map(|f| corners(world, f)).map(|[a, b, c]| ((a + b + c) / 3.0).truncate()).collect()
    };
    let (boards, posts): (Vec<DVec2>, Vec<DVec2>) =
        (middles(class::TRAFFIC_SIGN), middles(class::POLE));
    let mean = |all: &[DVec2], at: DVec2| {
        let near: Vec<DVec2> = all.iter().copied().filter(|p| p.distance(at) < 0.5).collect();
        near.iter().sum::<DVec2>() / near.len().max(1) as f64
    };
    let mut found: Vec<(DVec2, DVec2)> = Vec::new();
    for board in &boards {
        let middle = mean(&boards, *board);
        let post = mean(&posts, middle);
        if post != DVec2::ZERO && found.iter().all(|(known, _)| known.distance(middle) > 1.0) {
            found.push((middle, post));
        }
    }
    found
}

/// Class of an object of a name and a type, and whether it takes room.
fn classed(name: &str, kind: &str) -> (u16, bool) {
    let place = r#"s="50" t="2" length="1" width="1" height="1""#;
    let object = format!(r#"<object id="1" name="{name}" type="{kind}" {place}/>"#);
    let network = network(&road("RHT", "", "", &format!("<objects>{object}</objects>")));
    (network.shapes[0].class, network.shapes[0].solid)
}

#[test]
fn words_of_a_name_tell_the_class_of_an_object() {
    for (name, wanted) in [
        ("StreetLamp", class::POLE),
        ("Street_Light_01", class::POLE),
        ("StreetTree", class::VEGETATION),
        ("Traffic_Light", class::TRAFFIC_LIGHT),
        ("StreetSign", class::TRAFFIC_SIGN),
        ("street furniture", class::STATIC),
        ("stencil of a stop", class::STATIC),
    ] {
        assert_eq!(classed(name, "obstacle"), (wanted, true), "{name}");
    }
    assert_eq!(classed("thing", "none"), (class::STATIC, true));
    // Types of OpenDRIVE 1.4 for vehicles and persons on the road.
    for kind in ["car", "van", "bus", "trailer", "bike", "motorbike", "tram", "train"] {
        assert_eq!(classed("", kind), (class::VEHICLE, true), "{kind}");
    }
    assert_eq!(classed("", "pedestrian"), (class::PEDESTRIAN, true));
    // Maps of CARLA name arrows, words and hatched areas on the road so.
    for name in ["Stencil_STOP", "Stencil_ArrowType4L", "ChevronRegion"] {
        for kind in ["none", "-1"] {
            assert_eq!(classed(name, kind), (class::ROAD_LINE, false), "{name}");
        }
    }
}

#[test]
fn objects_of_unknown_types_are_told() {
    let told = |kind: &str| {
        let objects = format!(
            r#"<objects><object id="1" type="{kind}" s="50" t="9" length="1" width="1" height="1"/></objects>"#
        );
        let notes = network(&road("RHT", "", "", &objects)).notes;
        let of_types = notes.iter().find(|note| note.text().contains("of unknown types"));
        of_types.map(|note| (note.is_doubt(), note.text().to_owned()))
    };
    for known in ["building", "none", "-1", "", "car", "parkingSpace"] {
        assert_eq!(told(known), None, "{known}");
    }
    let (is_doubt, text) = told("guide-post").unwrap();
    assert!(
        !is_doubt && text.contains("m.xodr: 1 objects are of unknown types, `guide-post`"),
        "{text}"
    );
    let (is_doubt, text) = told("Building").unwrap();
    assert!(is_doubt && text.ends_with("did you mean `building`?"), "{text}");
}

#[test]
fn objects_become_shapes_of_their_class_and_size() {
    let objects = r#"<objects>
        <object id="1" name="guardRail" type="barrier" s="0" t="6.5" zOffset="0" hdg="0" length="0.2" width="0.2" height="0.8">
          <repeat s="0" length="200" distance="0" tStart="6.5" tEnd="6.5" heightStart="0.8" heightEnd="0.8"
            zOffsetStart="0" zOffsetEnd="0" widthStart="0.2" widthEnd="0.2"/></object>
        <object id="2" name="lamp" type="pole" s="100" t="-7" zOffset="0" hdg="0" radius="0.1" height="6"/>
        <object id="3" name="house" type="building" s="50" t="12" zOffset="0" hdg="0">
          <outline id="0" outer="true" closed="true"><cornerLocal id="0" u="0" v="0" z="0" height="5"/>
            <cornerLocal id="1" u="4" v="0" z="0" height="5"/><cornerLocal id="2" u="4" v="3" z="0" height="5"/>
            <cornerLocal id="3" u="0" v="3" z="0" height="5"/></outline></object>
        <object id="4" name="thing" type="none" s="20" t="9"/></objects>"#;
    let network = network(&road("RHT", "", "", objects));
    for (class, low, high) in [
        (class::GUARD_RAIL, [0.0, 6.4, 0.0], [200.0, 6.6, 0.8]),
        (class::POLE, [99.9, -7.1, 0.0], [100.1, -6.9, 6.0]),
        (class::BUILDING, [50.0, 12.0, 0.0], [54.0, 15.0, 5.0]),
    ] {
        let of_class = network.shapes.iter().filter(|shape| shape.class == class);
        let points: Vec<DVec3> = of_class.flat_map(|s| s.faces.iter().flatten().copied()).collect();
        let found = points.iter().fold([points[0]; 2], |[l, h], p| [l.min(*p), h.max(*p)]);
        let wanted = [DVec3::from(low), DVec3::from(high)];
        for (found, wanted) in found.iter().zip(wanted) {
            assert!((*found - wanted).abs().max_element() < 0.03, "{class}: {found} for {wanted}");
        }
    }
    assert_eq!(network.shapes.len(), 3);
    let notes: Vec<&str> = network.notes.iter().map(sightline_files::Note::text).collect();
    assert!(notes.iter().any(|n| n.contains("are left out: 1 of the type none")), "{notes:?}");
}

/// A bay whose lines are given is those lines; one without any is counted.
#[test]
fn a_parking_space_is_what_its_lines_enclose() {
    let bay = |id: u32, inside: &str| {
        format!(
            r#"<object id="{id}" name="bay" type="parkingSpace" s="60" t="8" zOffset="0" hdg="0" length="5" width="2.5"
            height="0">{inside}</object>"#
        )
    };
    let lines = r#"<markings><marking side="left" weight="standard" width="0.1" color="white" zOffset="0.005"
        spaceLength="0" lineLength="5" startOffset="0" stopOffset="0"/></markings>"#;
    let (count, paint) = (|n: &Network| (n.marks.len(), n.shapes.len()), bay(1, lines));
    let bare = network(&road("RHT", "", "", ""));
    let marked = network(&road("RHT", "", "", &format!("<objects>{paint}</objects>")));
    let both = format!("<objects>{paint}{}</objects>", bay(2, ""));
    let both = network(&road("RHT", "", "", &both));
    assert!(marked.marks.len() > bare.marks.len() && marked.shapes.is_empty());
    assert_eq!(count(&both), count(&marked));
    let told = |network: &Network| {
        network.notes.iter().filter(|note| note.text().contains("parking spaces have no")).count()
    };
    assert_eq!([told(&bare), told(&marked), told(&both)], [0, 0, 1]);
}

/// A crosswalk of lines is those lines; one without any is paint of its size, on the road.
#[test]
fn a_crosswalk_is_painted_once() {
    let crossing = |inside: &str| {
        let text = format!(
            r#"<objects><object id="1" name="zebra" type="crosswalk" s="90" t="0" zOffset="0" hdg="0" length="3"
            width="7" height="0.01">{inside}</object></objects>"#
        );
        network(&road("RHT", "", "", &text))
    };
    let plain = crossing("");
    assert_eq!(plain.shapes.len(), 1);
    assert!(plain.shapes[0].class == class::ROAD_LINE && !plain.shapes[0].solid);
    let lines = r#"<markings><marking side="left" weight="standard" width="0.5" color="white" zOffset="0.005"
        spaceLength="0" lineLength="3" startOffset="0" stopOffset="0"/></markings>"#;
    let lined = crossing(lines);
    assert!(lined.shapes.is_empty() && lined.marks.len() > plain.marks.len());
}

#[test]
fn signals_stand_where_the_map_says_or_are_counted() {
    let signals = r#"<signals>
        <signal id="1" name="a" s="50" t="-6" zOffset="2" hOffset="0" dynamic="no" orientation="+" type="274" subtype="50"
          height="0.7" width="0.6"/>
        <signal id="2" name="b" s="80" t="1" zOffset="0" hOffset="0" dynamic="no" orientation="+" type="274" subtype="50"/>
        <signal id="3" name="c" s="90" t="-1" zOffset="0" hOffset="0" dynamic="yes" orientation="+" type="1000001"
          subtype="-1"/></signals>"#;
    let world = import_opendrive(&road("RHT", "", "", signals), "m.xodr", 1, 2).unwrap();
    let notes: Vec<&str> = world.notes().iter().map(sightline_files::Note::text).collect();
    assert!(notes.iter().any(|n| n.contains("2 signals would stand on the road")), "{notes:?}");
    let at_sign = (0..world.mesh().faces.len()).filter(|f| {
        let middle = corners(&world, *f)[0];
        world.mesh().face_class[*f] == class::TRAFFIC_SIGN
            && middle.truncate().distance(DVec2::new(50.0, -6.0)) < 0.6
    });
    assert!(at_sign.count() >= 4);
}

#[test]
fn a_number_of_no_element_may_be_missing_written_with_a_comma_or_nan() {
    let record = |name: &str| record(name, "s", [0.0; 5]);
    let more = format!(
        r#"<elevationProfile>{}</elevationProfile><lateralProfile>{}</lateralProfile>
        <objects><object id="1" type="pole" s="10" t="9" zOffset="0" radius="0.1" height="6"/></objects>
        <signals><signal id="1" s="10" t="9" zOffset="0" hOffset="0" type="274" subtype="50"/></signals>"#,
        record("elevation"),
        record("superelevation")
    );
    let text = road("RHT", "", "", &more)
        .replace("<lanes>", &format!("<lanes>{}", record("laneOffset")))
        .replace("<line/>", r#"<arc curvature="0"/>"#);
    import_opendrive(&text, "m.xodr", 1, 2).unwrap();
    for (element, attributes) in [
        ("geometry", &["s", "x", "y", "hdg", "length"][..]),
        ("arc", &["curvature"]),
        ("elevation", &["s", "a", "b", "c", "d"]),
        ("superelevation", &["s", "a", "b", "c", "d"]),
        ("laneOffset", &["s", "a", "b", "c", "d"]),
        ("width", &["sOffset", "a", "b", "c", "d"]),
        ("object", &["s", "t", "zOffset", "radius", "height"]),
        ("signal", &["s", "t", "zOffset", "hOffset"]),
    ] {
        for attribute in attributes {
            for (value, expected) in
                [("0,5", "comma"), ("NaN", "not finite"), ("inf", "not finite")]
            {
                let start = text.find(&format!("<{element} ")).unwrap();
                let key = format!(" {attribute}=\"");
                let from = start + text[start..].find(&key).unwrap() + key.len();
                let to = from + text[from..].find('"').unwrap();
                let broken = format!("{}{value}{}", &text[..from], &text[to..]);
                let error = import_opendrive(&broken, "m.xodr", 1, 2).map(|_| ());
                assert_holds!(error.unwrap_err(), &format!("<{element}>"), expected);
            }
        }
    }
}

#[test]
fn changed_maps_are_read_or_refused() {
    use rand::{RngExt, SeedableRng};
    let count = std::env::var("MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(200_u64);
    let objects = r#"<objects><object id="1" type="barrier" s="0" t="6.5" length="0.2" width="0.2" height="0.8">
        <repeat s="0" length="200" distance="5" tStart="6.5" tEnd="6.5"/></object></objects><signals>
        <signal id="1" s="10" t="9" zOffset="0" hOffset="0" type="274" subtype="50" height="1" width="1"/></signals>"#;
    let height = r#"<height sOffset="0" inner="0.1" outer="0.3"/>"#;
    let seeds = [road("LHT", height, "parking", objects), fork()];
    let words = [
        "NaN", "1e300", "-1", "0", "1,5", "\"", "<", ">", "/>", "1e-300", "&amp;", "<line/>",
        " s=\"5\"",
    ];
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
    let mut read = 0;
    for k in 0..count {
        let mut text = seeds[k as usize % seeds.len()].clone().into_bytes();
        for _ in 0..rng.random_range(1..4) {
            let at = rng.random_range(0..text.len());
            let end = (at + rng.random_range(0..30)).min(text.len());
            match rng.random_range(0..4) {
                0 => text[at] = rng.random_range(32..127),
                1 => drop(text.drain(at..end)),
                2 => {
                    let piece = text[at..end].to_vec();
                    let to = rng.random_range(0..text.len());
                    text.splice(to..to, piece);
                }
                _ => {
                    // A number is replaced as a whole where one begins.
                    let word = words[rng.random_range(0..words.len())].bytes();
                    let quote =
                        text[at..].iter().position(|b| *b == b'"').map_or(at, |k| at + k + 1);
                    let len = text[quote..].iter().position(|b| *b == b'"').unwrap_or(0);
                    text.splice(quote..quote + len, word);
                }
            }
        }
        let text = String::from_utf8_lossy(&text);
        let start = std::time::Instant::now();
        read += u64::from(opendrive::network(&text, "m.xodr").is_ok());
        assert!(start.elapsed().as_secs() < 60, "{text}");
    }
    assert!(read > count / 20 && read < count, "{read} of {count}");
}

/// Height and y of both edges of the first driven lane to the right, at a place along x.
fn right_lane(network: &Network, x: f64) -> [DVec3; 2] {
    let strip = network.strips.iter().filter(|s| s.used == crate::network::StripUse::Road);
    let strip = strip.min_by(|a, b| a.left[0].y.abs().total_cmp(&b.left[0].y.abs())).unwrap();
    [&strip.left, &strip.right].map(|edge| {
        let pair = edge.windows(2).find(|pair| pair[0].x <= x && x <= pair[1].x).unwrap();
        pair[0].lerp(pair[1], (x - pair[0].x) / (pair[1].x - pair[0].x))
    })
}

/// A straight road of 120 m with one lane to the right, `profiles` before its lanes, `offsets` in them, `widths` in the lane.
fn text_of_lane(profiles: &str, offsets: &str, widths: &str) -> String {
    format!(
        r#"<OpenDRIVE><header revMajor="1" revMinor="6"/><road id="1" length="120" junction="-1">
        <planView><geometry s="0" x="0" y="0" hdg="0" length="120"><line/></geometry></planView>{profiles}
        <lanes>{offsets}<laneSection s="0"><center><lane id="0" type="none" level="false"/></center>
        <right><lane id="-1" type="driving" level="false">{widths}</lane></right></laneSection></lanes></road></OpenDRIVE>"#
    )
}

fn lane_of(profiles: &str, offsets: &str, widths: &str) -> Network {
    network(&text_of_lane(profiles, offsets, widths))
}

/// A cubic record: its place, a, b, c, d.
fn record(name: &str, place: &str, [s, a, b, c, d]: [f64; 5]) -> String {
    format!(r#"<{name} {place}="{s}" a="{a}" b="{b}" c="{c}" d="{d}"/>"#)
}

/// A bump of 2 m length between two points of the library: 0.2 x − 0.1 x², at most 0.1.
fn bump(x: f64) -> f64 {
    let x = x - 50.3;
    if (0.0..2.0).contains(&x) { 0.2 * x - 0.1 * x * x } else { 0.0 }
}

const BUMP: [[f64; 5]; 3] = [[0.0; 5], [50.3, 0.0, 0.2, -0.1, 0.0], [52.3, 0.0, 0.0, 0.0, 0.0]];

fn bumps(name: &str, place: &str) -> String {
    BUMP.map(|values| record(name, place, values)).concat()
}

#[test]
fn short_records_of_height_tilt_offset_and_width_shape_the_road() {
    let flat = record("width", "sOffset", [0.0, 3.5, 0.0, 0.0, 0.0]);
    // In plan and tilt a bump of 0.03 at most, beside a value that holds all along.
    let low = |name: &str, place: &str, value: f64, sign: f64| {
        let of = |[s, _, b, c, d]: [f64; 5]| {
            record(name, place, [s, value, sign * 0.3 * b, sign * 0.3 * c, d])
        };
        BUMP.map(of).concat()
    };
    let low_bump = |x: f64| 0.3 * bump(x);
    let raised = format!("<elevationProfile>{}</elevationProfile>", bumps("elevation", "s"));
    let tilted =
        format!("<lateralProfile>{}</lateralProfile>", low("superelevation", "s", 0.0, 1.0));
    // The own crossfall of the file stays: 2 % down to the right, then a bump.
    let fall = "<lateralProfile><crossfall s='0' side='right' a='0.02' b='0' c='0' d='0'/>\
                <crossfall s='80' side='left' a='0.1' b='0' c='0' d='0'/></lateralProfile>";
    let slope = |x: f64| if x < 80.0 { -0.02_f64.tan() * 3.5 } else { 0.0 };
    type Wanted = Box<dyn Fn(f64) -> [[f64; 2]; 2]>;
    let plain = |x: f64| [[0.0, bump(x)], [-3.5, bump(x)]];
    let cases: [(&str, Network, Wanted); 7] = [
        ("elevation", lane_of(&raised, "", &flat), Box::new(plain)),
        (
            "crossfall",
            lane_of(&format!("{raised}{fall}"), "", &flat),
            Box::new(move |x| [[0.0, bump(x)], [-3.5, bump(x) + slope(x)]]),
        ),
        (
            "empty lateralProfile",
            lane_of(&format!("{raised}<lateralProfile/>"), "", &flat),
            Box::new(plain),
        ),
        (
            "superelevation",
            lane_of(&tilted, "", &flat),
            Box::new(move |x| {
                let (sin, cos) = low_bump(x).sin_cos();
                [[0.0; 2], [-3.5 * cos, -3.5 * sin]]
            }),
        ),
        (
            "laneOffset",
            lane_of("", &low("laneOffset", "s", 0.0, 1.0), &flat),
            Box::new(move |x| [[low_bump(x), 0.0], [low_bump(x) - 3.5, 0.0]]),
        ),
        (
            "width",
            lane_of("", "", &low("width", "sOffset", 3.5, 1.0)),
            Box::new(move |x| [[0.0; 2], [-3.5 - low_bump(x), 0.0]]),
        ),
        (
            "border",
            lane_of("", "", &low("border", "sOffset", -3.5, -1.0)),
            Box::new(move |x| [[0.0; 2], [-3.5 - low_bump(x), 0.0]]),
        ),
    ];
    for (name, network, wanted) in cases {
        // Where a crossfall steps, the surface takes a step of the library to follow.
        for x in (10..1100).map(|k| 0.1 * f64::from(k)).filter(|x| !(77.0..81.0).contains(x)) {
            let found = right_lane(&network, x);
            for (edge, [y, z]) in found.iter().zip(wanted(x)) {
                let off = (edge.y - y).abs().max((edge.z - z).abs());
                assert!(off < 0.011, "{name} at {x}: {edge}, y = {y}, z = {z}");
            }
        }
    }
}

/// A steep piece of 1 km is followed, a straight road keeps the points of the library, and too many bends are told.
#[test]
fn points_come_where_a_road_bends_and_no_more() {
    let flat = record("width", "sOffset", [0.0, 3.5, 0.0, 0.0, 0.0]);
    let points = |network: &Network| network.strips[0].left.len();
    let even = points(&lane_of("", "", &flat));
    let rising = "<elevationProfile><elevation s='0' a='0' b='0.05' c='0' d='0'/>\
                  <elevation s='31' a='1.55' b='0.05' c='0.001' d='0'/></elevationProfile>";
    assert_eq!(points(&lane_of(rising, "", &flat)), even);
    let raised = format!("<elevationProfile>{}</elevationProfile>", bumps("elevation", "s"));
    let more = points(&lane_of(&raised, "", &flat));
    assert!(more > even + 3 && more < even + 20, "{more}, {even}");
    let many: String = (0..40_000)
        .map(|k| {
            let s = 0.25 * f64::from(k);
            record("elevation", "s", [s, 0.0, if k % 2 == 0 { 0.1 } else { -0.1 }, 0.0, 0.0])
        })
        .collect();
    let text = text_of_lane(&format!("<elevationProfile>{many}</elevationProfile>"), "", &flat);
    let network = network(&text.replace("\"120\"", "\"10000\""));
    let told: Vec<&str> = network.notes.iter().map(sightline_files::Note::text).collect();
    assert_holds!(told.join("\n"), "road 1 bends at more places than are followed");
}
