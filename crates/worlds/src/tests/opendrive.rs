//! OpenDRIVE: a small map by hand, maps that are none, and a real town where it lies beside the project.

use std::io::Read;
use std::path::Path;

use super::*;
use crate::{import_opendrive, read_opendrive};

/// Middles of lanes of the map by hand, computed from its lines and arcs: x, y, height.
fn middles() -> Vec<DVec3> {
    let mut places = Vec::new();
    for k in 1..12 {
        // Road 1: along x, rising by 2 %, lanes of 3.5 m.
        let s = 10.0 * f64::from(k);
        places.extend([-1.75, 1.75].map(|t| DVec3::new(s, t, 0.02 * s)));
        // Road 3: the same on the level.
        places.extend([-1.75, 1.75].map(|t| DVec3::new(140.0 + s, t, 2.4)));
        // Road 11: an arc of radius 20 to the left about (120, 20), one lane to the right.
        let angle = 1.0 * f64::from(k) / 12.0;
        let radius = 20.0 + 1.75;
        places.push(DVec3::new(120.0 + radius * angle.sin(), 20.0 - radius * angle.cos(), 2.4));
    }
    places
}

#[test]
fn lanes_of_a_map_lie_where_its_lines_and_arcs_say() {
    let world = import_opendrive(&fork(), "fork.xodr", 1, 20).unwrap();
    let places = middles();
    let raised: Vec<DVec3> = places.iter().map(|p| *p + DVec3::Z * 0.3).collect();
    for (place, found) in places.iter().zip(below(&world, &raised)) {
        let (class, z) = found.unwrap();
        assert!(["road", "road_line"].contains(&class), "{class} at {place}");
        assert!((z - place.z).abs() < 0.02, "{z} at {place}");
    }
    let scene = read_back(&world);
    ego_stands_on_the_road(&world, &scene, 0.05, "fork");
    nobody_runs_into_another(&scene, "fork");
    nothing_stands_on_the_road(&world, "fork");
    let walk = below(&world, &[DVec3::new(60.0, 4.5, 2.0)])[0].unwrap();
    assert_eq!(walk.0, "sidewalk");
    assert!((walk.1 - (1.2 + 0.13)).abs() < 0.01, "{walk:?}");
}

#[test]
fn a_map_without_what_a_world_needs_is_refused_with_a_sentence() {
    let told = |text: &str| import_opendrive(text, "m.xodr", 1, 40).unwrap_err().to_string();
    let cases = [
        ("", "m.xodr: invalid OpenDRIVE XML"),
        ("<OpenDRIVE><road", "m.xodr: invalid OpenDRIVE XML"),
        ("<OpenDRIVE></OpenDRIVE>", "at least one road"),
        (&fork().replace("\"driving\"", "\"sidewalk\""), "no lane of the type `driving`"),
        (&fork().replace("a=\"3.5\"", "a=\"350\""), "metres of its widest lane are 350"),
        (&fork().replace("x=\"140\"", "x=\"4e6\""), "farthest coordinate"),
        (&fork().replace("length=\"120\"", "length=\"90000\""), "metres of its roads"),
    ];
    for (text, expected) in cases {
        let told = told(text);
        assert!(told.contains(expected), "{told}");
        assert_eq!(told.lines().count(), 1, "{told}");
    }
    let short = fork().replace("length=\"120\"", "length=\"9\"");
    let error = import_opendrive(&short, "m.xodr", 1, 1000).unwrap_err().to_string();
    assert!(error.ends_with("; ask for fewer frames or give a larger network"), "{error}");
}

/// One road with a lane to each side: 100 m are the least, also for 40 frames, whose slowest ego needs less.
#[test]
fn a_road_that_is_too_short_is_told_with_its_length() {
    let road = |length: f64, frames: usize| {
        let map = straight("", "").replace("'200'", &format!("'{length}'"));
        import_opendrive(&map, "m.xodr", 1, frames).map_err(|error| error.to_string())
    };
    for frames in [1, 40] {
        let told = road(99.9, frames).unwrap_err();
        assert!(told.contains("is 100 m long, the longest tried has 99.9 m; ask"), "{told}");
        assert!(road(99.98, frames).unwrap_err().contains("has 99.9 m"));
        road(110.0, frames).unwrap();
    }
}

#[test]
fn geometry_that_is_no_finite_number_is_an_error_with_its_road_and_element() {
    let swap = |from: &str, to: &str| {
        let plain = straight("", "");
        assert!(plain.contains(from), "{from}");
        plain.replacen(from, to, 1)
    };
    let shape = |shape: &str| swap("<line/>", shape);
    let curve = |v: &str| {
        shape(&format!(
            "<paramPoly3 pRange='arcLength' aU='0' bU='1' cU='0' dU='0' aV='0' bV='0' {v}/>"
        ))
    };
    let length = |value: &str| swap("hdg='0' length='200'", &format!("hdg='0' length='{value}'"));
    let cases = [
        (curve("cV='-1e308' dV='0'"), "road 1, <paramPoly3> `aV`, `bV`, `cV`, `dV` lead"),
        (curve("cV='0' dV='1e308'"), "road 1, <paramPoly3> `aV`, `bV`, `cV`, `dV` lead"),
        (curve("cV='1e20' dV='0'"), "road 1, <paramPoly3>"),
        (swap("x='0'", "x='1e308'"), "<geometry> with s = 0 `x` is 1e308, beyond"),
        (length("-5"), "<geometry> with s = 0 `length` is -5; write"),
        (length("-1e308"), "`length` is -1e308, beyond"),
        (shape("<arc curvature='1e308'/>"), "<arc> `curvature` is 1e308"),
        (swap("a='3.5'", "a='1e308'"), "<width> with sOffset = 0 `a`, `b`, `c`, `d` lead"),
    ];
    for (text, expected) in cases {
        assert_holds!(import_opendrive(&text, "m.xodr", 1, 20).unwrap_err(), expected);
    }
    import_opendrive(&curve("cV='1e-3' dV='0'"), "m.xodr", 1, 20).unwrap();
}

#[test]
fn a_number_or_a_shape_that_cannot_be_read_is_an_error_with_its_road() {
    let cases = [
        ("x=\"140\"", "x=\"NaN\"", "`x` is `NaN`, not finite"),
        ("x=\"140\"", "x=\"140,5\"", "with a comma"),
        ("x=\"140\"", "", "has no `x`"),
        ("<line/>", "<clothoid/>", "the unknown shape <clothoid>"),
        ("a=\"3.5\"", "a=\"wide\"", "`a` is `wide`, not a number"),
    ];
    for (from, to, expected) in cases {
        let text = fork().replace(from, to);
        assert_ne!(text, fork(), "{from}");
        assert_holds!(import_opendrive(&text, "m.xodr", 1, 10).unwrap_err(), expected, "road ");
    }
}

#[test]
fn a_file_that_is_no_text_says_what_to_do() {
    let dir = TempDir::new().unwrap();
    let told = |name: &str, bytes: &[u8]| {
        std::fs::write(dir.path().join(name), bytes).unwrap();
        read_opendrive(&dir.path().join(name)).unwrap_err().to_string()
    };
    assert!(told("a.xodr.gz", &[0x1f, 0x8b, 8, 0]).contains("gunzip"));
    assert!(told("b.xodr", &[0xff, 0xfe, 0x00]).contains("UTF-8"));
    assert_holds!(read_opendrive(&dir.path().join("none.xodr")).unwrap_err(), "none.xodr");
}

#[test]
#[cfg_attr(
    not(has_xodr),
    ignore = "the towns of CARLA lie beside the checkout or where SIGHTLINE_DATA says"
)]
fn real_towns_are_driven_through() {
    for town in ["Town01", "Town03", "Town04", "Town06"] {
        let path = Path::new(env!("REAL_DATA")).join(format!("xodr/carla/{town}.xodr.gz"));
        let packed = std::fs::File::open(path).unwrap();
        let mut text = String::new();
        flate2::read::GzDecoder::new(packed).read_to_string(&mut text).unwrap();
        let world = import_opendrive(&text, town, 1, 40).unwrap();
        assert_eq!(world.network.lanes.len(), text.matches("type=\"driving\"").count(), "{town}");
        assert!(world.mesh().faces.len() < 4_000_000, "{town}: {}", world.mesh().faces.len());
        let scene = read_back(&world);
        ego_stands_on_the_road(&world, &scene, 0.1, town);
        nobody_runs_into_another(&scene, town);
        nothing_stands_on_the_road(&world, town);
    }
}

/// A straight road of 200 m with two lanes; `more` stands in the road, `after` behind it.
fn straight(more: &str, after: &str) -> String {
    let lane = |id: i32| {
        format!(
            "<lane id='{id}' type='driving'><width sOffset='0' a='3.5' b='0' c='0' d='0'/></lane>"
        )
    };
    format!(
        "<OpenDRIVE><header revMajor='1' revMinor='6'/><road id='1' length='200'><link/><planView>\
         <geometry s='0' x='0' y='0' hdg='0' length='200'><line/></geometry></planView><lanes><laneSection s='0'>\
         <left>{}</left><center><lane id='0' type='none'/></center><right>{}</right></laneSection></lanes>{more}</road>\
         {after}</OpenDRIVE>",
        lane(1),
        lane(-1)
    )
}

#[test]
fn values_with_a_silent_default_are_refused() {
    let plain = straight("", "");
    let object = |more: &str| straight(&format!("<objects><object id='1' {more}</objects>"), "");
    let pole = |s: f64| object(&format!("type='pole' s='{s}' t='6' height='4' radius='0.1'/>"));
    let swap = |from: &str, to: &str| {
        assert!(plain.contains(from), "{from}");
        plain.replacen(from, to, 1)
    };
    let linked =
        |successor: &str| swap("<link/>", &format!("<link><successor {successor}/></link>"));
    let curve =
        "<paramPoly3 aU='0' bU='200' cU='0' dU='0' aV='0' bV='0' cV='0' dV='0' pRange='foo'/>";
    let marked = "s='1' t='6'><markings><marking width='wide'/></markings></object>";
    let board = "<signals><signal id='1' s='50' t='-6' height='600' width='1'/></signals>";
    let bare = "<geometry s='0' x='0' y='0' hdg='0' length='200'><line/></geometry>";
    let cases = [
        (swap("a='3.5'", "a='-3.5'"), "<width> with sOffset = 0 is a width of -3.500 m at 0.00 m"),
        // 3.5 − 0.1 s + 0.0005 s² has its lowest value at s = 100: 3.5 − 10 + 5.
        (swap("b='0' c='0'", "b='-0.1' c='0.0005'"), "a width of -1.500 m at 100.00 m"),
        (pole(500.0), "<object> with s = 500 stands at s = 500, off its road of 200 m"),
        (pole(-50.0), "stands at s = -50, off its road"),
        (
            straight("<signals><signal id='1' s='200.001' t='-6'/></signals>", ""),
            "<signal> with s = 200.001 stands at s = 200.001, off its road of 200 m; write an s of 0 to 200",
        ),
        (
            object("s='0' t='6'><repeat s='300' length='5' distance='1'/></object>"),
            "stands at s = 300, off its road",
        ),
        (swap("<line/>", curve), "`pRange` is `foo`; write one of arcLength, normalized"),
        (
            linked("elementType='road' elementId='1' contactPoint='middle'"),
            "`contactPoint` is `middle`; write one of start, end",
        ),
        (linked("elementType='street' elementId='1'"), "`elementType` is `street`"),
        (
            swap("</lane>", "<width sOffset='0' a='3' b='0' c='0' d='0'/></lane>"),
            "has two <width> with sOffset = 0",
        ),
        (straight("", "<road id='1' length='5'/>"), "has the id of a road before it"),
        (swap("<lanes>", "<lanes layer='top'>"), "`layer` is `top`"),
        (object(marked), "`width` is `wide`"),
        (
            plain
                .replace("length='200'", "length='50000'")
                .replace("<line/>", "<arc curvature='1000'/>"),
            "road 1, <arc> `curvature` of 1000 over 50000 m are 7957747 turns, at most 100 are read",
        ),
        (
            plain.replace("<line/>", "<spiral curvStart='0' curvEnd='-1e6'/>"),
            "<spiral> `curvStart`, `curvEnd` of 0, -1000000 over 200 m are 15915494 turns",
        ),
        (straight(board, ""), "<signal> with s = 50 `height` is 600 m; write at most 100 m"),
        (plain.replace("length='200'", "length='1e9'"), "metres of its roads"),
        (swap(bare, ""), "road \"1\" skipped: "),
    ];
    for (text, told) in cases {
        let error =
            import_opendrive(&text, "m.xodr", 1, 20).map(|_| ()).expect_err(told).to_string();
        assert!(error.starts_with("m.xodr: ") && error.contains(told), "{error}\nis not {told}");
    }
    // Records that say one thing twice, and widths below 0 by rounding, change nothing.
    for text in [
        swap("</lane>", "<width sOffset='0' a='3.5' b='0' c='0' d='0'/></lane>"),
        swap("a='3.5' b='0'", "a='3.5' b='-0.01750001'"),
    ] {
        assert!(import_opendrive(&text, "m.xodr", 1, 20).is_ok());
    }
}

#[test]
fn parts_that_are_passed_over_are_counted() {
    let objects = "<objects><object id='7' type='building' s='50' t='30' length='9' width='9'/>\
                   <object id='8' type='barrier' s='0' t='8' height='1'><repeat s='150' length='90' distance='0' \
                   tStart='8' tEnd='8' heightStart='1' heightEnd='1' widthStart='0.2' widthEnd='0.2'/></object>\
                   <object id='9' type='barrier' s='50' t='9' height='2'><outline><cornerLocal u='0' v='0'/>\
                   <cornerLocal u='3' v='0'/><cornerLocal u='3' v='1'/></outline></object></objects>";
    let bare = "<road id='5' length='9'><planView><geometry s='0' x='0' y='90' hdg='0' length='9'><line/></geometry>\
                </planView><lanes><laneSection s='0'><center><lane id='0' type='none'/></center></laneSection></lanes>\
                </road></OpenDRIVE>";
    let link = "<link><successor elementType='road' elementId='99' contactPoint='start'/></link>";
    let text =
        straight(objects, "").replace("<link/>", link).replace("revMinor='6'", "revMinor='3'");
    let text = text.replace("</OpenDRIVE>", bare);
    let notes = super::super::opendrive::network(&text, "m").unwrap().notes;
    for (told, doubt) in [
        ("m: 2 objects have no `height` and lie flat on the ground, first object 7", false),
        (
            "m: 1 objects reach beyond the ends of their roads and are cut there, first object 8",
            false,
        ),
        ("m: 1 links lead to roads or junctions that are not in the file, first to 99", false),
        ("m: 1 roads have no lane beside their middle, and so no surface, first road 5", false),
        ("m: <header> states revMajor 1, revMinor 3", true),
    ] {
        let found = notes.iter().find(|note| note.text().starts_with(told));
        assert_eq!(found.map(sightline_files::Note::is_doubt), Some(doubt), "{told}: {notes:?}");
    }
    let plain = super::super::opendrive::network(&straight("", ""), "m").unwrap().notes;
    assert!(plain.is_empty(), "{plain:?}");
}

#[test]
fn roads_and_lanes_that_do_not_fit_are_doubted_by_name() {
    let plain = straight("", "");
    let told = |from: &str, to: &str| {
        assert!(plain.contains(from), "{from}");
        let network = super::super::opendrive::network(&plain.replacen(from, to, 1), "m").unwrap();
        let doubts = network.notes.iter().filter(|note| note.is_doubt());
        doubts.map(ToString::to_string).collect::<Vec<_>>().join("; ")
    };
    let of_junction = |id: &str| told("length='200'>", &format!("length='200' junction='{id}'>"));
    assert_eq!([of_junction("-1"), of_junction("")], [String::new(), String::new()]);
    assert_holds!(of_junction("42"), "1 roads belong to junctions", "first road 1 to junction 42;");
    let gap = told("id='-1'", "id='-3'");
    let where_it_is = "road 1, where lane -3 stands in place of lane -1;";
    assert_holds!(gap, "1 sides of lane sections", where_it_is);
    // The first half bends by 0.5 rad on 100 m, and ends at (200 sin 0.5, 200 (1 - cos 0.5)).
    let bent = |hdg: f64| {
        let (sin, cos) = 0.5_f64.sin_cos();
        let (x, y) = (200.0 * sin, 200.0 * (1.0 - cos));
        let halves = format!(
            "length='100'><arc curvature='0.005'/></geometry><geometry s='100' x='{x}' y='{y}' hdg='{hdg}' \
             length='100'><line/></geometry>"
        );
        told("length='200'><line/></geometry>", &halves)
    };
    assert_eq!([bent(0.5), bent(0.5 - std::f64::consts::TAU)], [String::new(), String::new()]);
    assert!(bent(1.2).contains("at s = 100 begins with a turn of 0.70 rad"), "{}", bent(1.2));
    let bare = told("<header revMajor='1' revMinor='6'/>", "");
    assert_holds!(bare, "m: has no <header>; the document is read as OpenDRIVE 1.4 to 1.9");
}

/// No record holds a value of 0, also before the first one: a shift of 1 m, and a tilt of 0.1 rad, from 50 m on.
#[test]
fn tilts_and_offsets_that_begin_late_are_0_before() {
    let lane =
        format!("<lane id=\"-1\" type=\"driving\" level=\"false\">{}</lane>", width(0.0, 3.0, 0.0));
    let late =
        |record: &str, a: f64| format!("<{record} s=\"50\" a=\"{a}\" b=\"0\" c=\"0\" d=\"0\"/>");
    let text = one_road(&late("superelevation", 0.1), &lane)
        .replace("<lanes>", &format!("<lanes>{}", late("laneOffset", 1.0)));
    let network = crate::opendrive::network(&text, "m.xodr").unwrap();
    let mut seen = [0; 2];
    for strip in &network.strips {
        for (left, right) in strip.left.iter().zip(&strip.right) {
            let (is_late, (sin, cos)) = (left.x > 50.1, 0.1_f64.sin_cos());
            if (left.x - 50.0).abs() < 0.1 {
                continue;
            }
            seen[usize::from(is_late)] += 1;
            for (point, t) in [(left, 0.0), (right, -3.0)] {
                let wanted = if is_late { [(t + 1.0) * cos, (t + 1.0) * sin] } else { [t, 0.0] };
                let off = (point.y - wanted[0]).abs().max((point.z - wanted[1]).abs());
                assert!(off < 1e-3, "{point} is not {wanted:?}");
            }
        }
    }
    assert!(seen.iter().all(|count| *count > 10), "{seen:?}");
}

/// Heights below 0 are heights; a height that is no number is refused with its road.
#[test]
fn heights_below_0_are_read_and_heights_that_are_none_refused() {
    let lane = |high: &str| {
        format!(
            "<lane id=\"-1\" type=\"driving\" level=\"false\">{}<height sOffset=\"0\" inner=\"{high}\" outer=\"{high}\"/></lane>",
            width(0.0, 3.0, 0.0)
        )
    };
    let of = |low: &str, high: &str| {
        let profile = format!(
            "<elevationProfile><elevation s=\"0\" a=\"{low}\" b=\"0\" c=\"0\" d=\"0\"/></elevationProfile>"
        );
        let text = one_road("", &lane(high)).replace("<elevationProfile/>", &profile);
        crate::opendrive::network(&text, "m.xodr").map_err(|error| error.to_string())
    };
    let network = of("-12", "-0.1").unwrap();
    let heights = network.strips.iter().flat_map(|strip| strip.left.iter().chain(&strip.right));
    assert!(heights.clone().count() > 10);
    heights.for_each(|p| assert!((p.z + 12.1).abs() < 1e-4, "{p}"));
    let told = of("NaN", "0").unwrap_err();
    assert!(told.contains("road 1, <elevation> with s = 0 `a` is `NaN`, not finite"), "{told}");
    let told = of("0", "NaN").unwrap_err();
    assert_holds!(told, "road 1, <height> with sOffset = 0 `inner` is `NaN`, not finite");
}

/// An outline of 50 000 corners takes no time of their square.
#[test]
fn outlines_of_many_corners_end_soon() {
    let corner = |k: u32| {
        let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / 50_000.0).sin_cos();
        format!("<cornerLocal u='{}' v='{}' z='0' height='4'/>", 8.0 * cos, 8.0 * sin)
    };
    let outline: String = (0..50_000).map(corner).collect();
    let object = format!(
        "<objects><object id='1' type='building' s='50' t='30' height='4'><outline>{outline}</outline></object></objects>"
    );
    let began = std::time::Instant::now();
    let read = import_opendrive(&straight(&object, ""), "m.xodr", 1, 20);
    assert_holds!(read.map(|_| ()).unwrap_err(), "50000 corners");
    assert!(began.elapsed().as_secs() < 10);
}

/// A road of 100 m along x with these lanes to the right of its reference line, and this lateral profile.
fn one_road(lateral: &str, right: &str) -> String {
    format!(
        "<?xml version=\"1.0\"?><OpenDRIVE><header revMajor=\"1\" revMinor=\"6\"/><road id=\"1\" junction=\"-1\" length=\"100\">\
         <planView><geometry s=\"0\" x=\"0\" y=\"0\" hdg=\"0\" length=\"100\"><line/></geometry></planView><elevationProfile/>\
         <lateralProfile>{lateral}</lateralProfile><lanes><laneSection s=\"0\"><center><lane id=\"0\" type=\"none\"/></center>\
         <right>{right}</right></laneSection></lanes></road></OpenDRIVE>"
    )
}

fn width(start: f64, a: f64, b: f64) -> String {
    format!("<width sOffset=\"{start}\" a=\"{a}\" b=\"{b}\" c=\"0\" d=\"0\"/>")
}

/// A parking bay that opens at 45° beside a lane of 3.5 m, and a walk outside of it.
#[test]
fn widths_of_lanes_that_taper_are_measured_square_to_the_road() {
    let bay = [width(0.0, 0.0, 0.0), width(20.0, 0.0, 1.0), width(22.5, 2.5, 0.0)].concat();
    let lanes =
        [("driving", width(0.0, 3.5, 0.0)), ("parking", bay), ("sidewalk", width(0.0, 2.0, 0.0))];
    let lane = |(i, (kind, widths)): (usize, &(&str, String))| {
        format!("<lane id=\"-{}\" type=\"{kind}\" level=\"false\">{widths}</lane>", i + 1)
    };
    let text = one_road("", &lanes.iter().enumerate().map(lane).collect::<String>());
    let network = crate::opendrive::network(&text, "bay.xodr").unwrap();
    let edges = network.strips.iter().flat_map(|strip| strip.left.iter().chain(&strip.right));
    for p in edges {
        let opened = (p.x - 20.0).clamp(0.0, 2.5);
        let right = [0.0, -3.5, -3.5 - opened, -5.5 - opened];
        let off = right.iter().map(|y| (p.y - y).abs()).fold(f64::INFINITY, f64::min);
        assert!(off < 2e-3, "an edge at {p}, {off} m beside the file's");
    }
}

#[test]
fn a_surface_that_bends_inside_a_lane_is_doubted() {
    let lane =
        format!("<lane id=\"-1\" type=\"driving\" level=\"false\">{}</lane>", width(0.0, 8.0, 0.0));
    let shape = |t: f64, a: f64, b: f64| {
        format!("<shape s=\"0\" t=\"{t}\" a=\"{a}\" b=\"{b}\" c=\"0\" d=\"0\"/>")
    };
    let told = |lateral: &str| {
        let notes = crate::opendrive::network(&one_road(lateral, &lane), "m.xodr").unwrap().notes;
        notes.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
    };
    // A crown in the middle of the lane: 2.5 % to either side, 0.1 m at the edges.
    let crown = told(&[shape(-8.0, 0.0, 0.025), shape(-4.0, 0.1, -0.025)].concat());
    assert!(crown.contains("road 1 bends its surface inside lane -1 by 0.10 m"), "{crown}");
    assert!(!told(&shape(-8.0, 0.0, 0.025)).contains("bends"), "a plane does not bend");
    let section = told("<crossSectionSurface><surfaceStrips/></crossSectionSurface>");
    assert!(section.contains("<crossSectionSurface> of road 1 may bend"), "{section}");
}
