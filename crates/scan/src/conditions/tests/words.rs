//! Conditions as they are written.

use crate::ScanError;
use crate::conditions::{Condition, ConditionKind, weather};

fn read(text: &str) -> Result<Condition, ScanError> {
    text.parse()
}

#[test]
fn what_is_written_out_reads_as_the_same() {
    for text in [
        "fog", "fog:mor=50", "fog:mor=inf,gain=0", "wet:water=1.0", "rain", "rain:rate=12.5",
        "blur", "crosstalk:share=0.01", "echo:ratio=0.85", "snow:level=light",
    ] {
        let condition = read(text).unwrap();
        assert_eq!(read(&condition.to_string()), Ok(condition), "{text} → {condition}");
    }
    let fog = read("fog:level=heavy").unwrap();
    assert_eq!(
        (fog.kind(), fog.value("mor"), fog.value("rate")),
        (ConditionKind::Fog, Some(50.0), None)
    );
    assert_eq!(read("rain:level=heavy").unwrap().to_string(), "rain:rate=25");
    assert_eq!(read("fog").unwrap().to_string(), "fog:mor=200");
    assert_eq!(read("fog:gain=2").unwrap().to_string(), "fog:mor=200,gain=2");
    assert_eq!(read("snow:rate=0.1,level=heavy").unwrap().to_string(), "snow:rate=0.1");
}

#[test]
fn what_cannot_be_is_said_in_a_sentence() {
    let table = [
        (
            "",
            "there is no condition ``; known are fog, wet, snow, rain, blur, crosstalk and echo, with values behind \
             a colon, as in fog:mor=200",
        ),
        (
            "fog=200",
            "there is no condition `fog=200`; known are fog, wet, snow, rain, blur, crosstalk and echo, with values \
             behind a colon, as in fog:mor=200",
        ),
        ("fog:50", "`50` in the condition `fog:50` is no KEY=VALUE; fog takes level, mor, gain"),
        ("fog:", "`` in the condition `fog:` is no KEY=VALUE; fog takes level, mor, gain"),
        ("fog:mor=0.5", "`mor=0.5` of fog: wanted is a number from 1 m on"),
        ("fog:mor=-50", "`mor=-50` of fog: wanted is a number from 1 m on"),
        ("fog:mor=NaN", "`mor=NaN` of fog: wanted is a number from 1 m on"),
        ("wet:water=1e9", "`water=1e9` of wet: wanted is a number from 0 to 100 mm"),
        ("echo:ratio=much", "`ratio=much` of echo: wanted is a number from 0 to 1"),
        ("fog:beta=0.05", "fog has no key `beta`; it takes level, mor, gain"),
        ("snow:depth=1", "snow has no key `depth`; it takes level, rate, speed"),
        ("fog:mor=50,mor=60", "the condition `fog:mor=50,mor=60` gives `mor` twice; give it once"),
        (
            "snow:mode=robo3d",
            "snow has no key `mode`; it takes level, rate, speed; for the corruptions of Robo3D run its own \
             program on a set of `--layout semantickitti` (docs/scans.md)",
        ),
        ("rain:rate=-1", "`rate=-1` of rain: wanted is a number from 0 to 200 mm/h"),
        ("fog:level=dense", "`level=dense` of fog: `dense` is not one of light, moderate, heavy"),
    ];
    for (text, wanted) in table {
        assert_eq!(read(text).unwrap_err().to_string(), wanted);
    }
}

#[test]
fn a_condition_may_stand_once() {
    let all = ["fog", "snow", "rain"].map(|text| read(text).unwrap());
    let found = weather(&all).unwrap();
    assert!(found.fog.is_some() && found.snow.is_some() && found.wet.is_none());
    assert_eq!(found.falls().count(), 2, "snow and rain");
    let twice = ["fog", "fog:mor=50"].map(|text| read(text).unwrap());
    let words = weather(&twice).unwrap_err().to_string();
    assert_eq!(words, "the condition fog is given twice; give it once");
}
