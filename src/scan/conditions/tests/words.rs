//! Conditions as they are written.

use crate::scan::conditions::{Condition, ConditionError, Kind, Mode, sort};

fn read(text: &str) -> Result<Condition, ConditionError> {
    text.parse()
}

#[test]
fn what_is_written_out_reads_as_the_same() {
    for text in [
        "fog",
        "fog:mor=50",
        "fog:mor=inf,gain=0",
        "fog:level=heavy,mode=robo3d",
        "wet:water=1.0",
        "fog:mode=robo3d,alpha=0.06",
        "wet:mode=robo3d,floor=0.7",
        "snow:mode=robo3d,rate=2.5,speed=1.6",
        "blur",
        "blur:mode=robo3d",
        "crosstalk:share=0.01",
        "echo:ratio=0.85",
        "snow:level=light",
    ] {
        let condition = read(text).unwrap();
        assert_eq!(read(&condition.to_string()), Ok(condition), "{text} → {condition}");
    }
    let fog = read("fog:mode=robo3d,level=heavy").unwrap();
    assert_eq!(fog.to_string(), "fog:mode=robo3d,beta=0.2");
    assert_eq!((fog.kind(), fog.mode()), (Kind::Fog, Mode::Robo3d));
    assert_eq!((fog.value("beta"), fog.value("alpha"), fog.value("mor")), (Some(0.2), None, None));
    assert_eq!(read("fog").unwrap().to_string(), "fog:mor=200,gain=1");
    assert_eq!(read("snow:rate=0.1,level=heavy").unwrap().to_string(), "snow:rate=0.1,speed=1.6");
}

#[test]
fn what_cannot_be_is_said_in_a_sentence() {
    let table = [
        ("", "there is no condition ``; known are fog, wet, snow, blur, crosstalk and echo"),
        (
            "rain:rate=1",
            "there is no condition `rain`; known are fog, wet, snow, blur, crosstalk and echo",
        ),
        (
            "fog:50",
            "`50` in the condition `fog:50` is no KEY=VALUE; fog takes mode, level, mor, gain",
        ),
        ("fog:", "`` in the condition `fog:` is no KEY=VALUE; fog takes mode, level, mor, gain"),
        ("fog:mor=0.5", "`mor=0.5` of fog: wanted is a number from 1 to inf m"),
        ("fog:mor=-50", "`mor=-50` of fog: wanted is a number from 1 to inf m"),
        ("fog:mor=NaN", "`mor=NaN` of fog: wanted is a number from 1 to inf m"),
        ("wet:water=1e9", "`water=1e9` of wet: wanted is a number from 0 to 100 mm"),
        ("echo:ratio=much", "`ratio=much` of echo: wanted is a number from 0 to 1"),
        (
            "fog:beta=0.05",
            "fog in the mode physical has no key `beta`; it takes mode, level, mor, gain; \
             `mode=robo3d` has `beta`",
        ),
        (
            "snow:depth=1",
            "snow in the mode physical has no key `depth`; it takes mode, level, rate, speed",
        ),
        ("fog:mor=50,mor=60", "the condition `fog:mor=50,mor=60` gives `mor` twice; give it once"),
        ("fog:mode=exact", "`mode=exact` of fog: `exact` is not one of physical, robo3d"),
        ("fog:level=dense", "`level=dense` of fog: `dense` is not one of light, moderate, heavy"),
    ];
    for (text, wanted) in table {
        assert_eq!(read(text).unwrap_err().to_string(), wanted);
    }
}

#[test]
fn a_condition_may_stand_once_in_each_mode() {
    let all = ["fog", "fog:mode=robo3d", "snow"].map(|text| read(text).unwrap());
    let (weather, corruptions) = sort(&all).unwrap();
    assert!(weather.fog.is_some() && weather.snow.is_some() && weather.wet.is_none());
    assert_ne!(corruptions, Default::default());
    let twice = ["fog", "fog:mor=50"].map(|text| read(text).unwrap());
    let words = sort(&twice).unwrap_err().to_string();
    assert_eq!(words, "the condition fog is given twice in the mode physical; give it once");
}
