//! Libraries of HSMWorks and Fusion 360 as XML.

use super::profiles::{library, radii};
use super::*;

pub(super) const SHOP: &str = r#"<?xml version="1.0" encoding="UTF-16" standalone="no"?>
<?xml-stylesheet type='text/xsl' href='tool-library.xsl'?>
<!-- made for this test -->
<tool-library xmlns="http://www.hsmworks.com/xml/2004/cnc/tool-library" guid="{0}" version="14">
  <tool guid="{1}" id="1" type="ball end mill" unit="millimeters" version="1.5">
    <description>6 mm ball &amp; long</description>
    <manufacturer>M</manufacturer>
    <nc number="4" diameter-offset="4" turret="0"/>
    <coolant mode="flood"/>
    <body diameter="6" corner-radius="3" flute-length="12" shoulder-length="30" body-length="45" overall-length="80"
      shaft-diameter="6" number-of-flutes="2" coolant-support="no"/>
    <holder description="ER20" guid="{2}" gauge-length="40">
      <section diameter="28" length="0"/>
      <section diameter="34" length="8"/>
      <section diameter="34" length="22"/>
      <section diameter="40" length="0"/>
      <section diameter="40" length="30"/>
    </holder>
    <motion spindle-rpm="8000"/>
    <presets><preset name="Default"><parameter key="tool_spindleSpeed" value="8000"/></preset></presets>
  </tool>
  <tool type="chamfer mill" unit="inches">
    <description>1/4" Chamfer</description>
    <body diameter="0.25" tip-diameter="0" taper-angle="45" flute-length="0.125" shoulder-length="1" body-length="1.5"
      overall-length="2.5" shaft-diameter="0.25"/>
  </tool>
  <tool type="spot drill" unit="millimeters"><product-id>SD6</product-id>
    <shaft><section diameter="6" length="0"/><section diameter="8" length="4"/></shaft>
    <body diameter="6" taper-angle="90" flute-length="12" body-length="30" overall-length="60" shaft-diameter="6"/></tool>
  <tool type="thread mill" unit="millimeters"><description>&#216; M6 &#xE9;</description>
    <body diameter="4.5" thread-pitch="1" thread-profile-angle="60" number-of-teeth="2" flute-length="2" body-length="30"
      shoulder-diameter="3.4" shoulder-length="15" overall-length="60" shaft-diameter="6"/></tool>
  <tool type="drill" unit="millimeters"><description>D5</description><body diameter="5" taper-angle="118"/></tool>
  <tool type="flat end mill" unit="millimeters"><description>odd</description><body diameter="wide"/></tool>
  <tool type="flat end mill" unit="millimeters"><description>none</description><body flute-length="9"/></tool>
</tool-library>
"#;

fn utf16(text: &str, big: bool) -> Vec<u8> {
    let unit = |u: u16| if big { u.to_be_bytes() } else { u.to_le_bytes() };
    [0xfeff].into_iter().chain(text.encode_utf16()).flat_map(unit).collect()
}

#[test]
fn a_library_in_xml_gives_the_tools_of_the_same_in_json() {
    let read = |bytes: &[u8]| from_bytes(bytes, "shop.hsmlib".as_ref(), &library()).unwrap();
    let table = read(SHOP.as_bytes());
    for bytes in [utf16(SHOP, false), utf16(SHOP, true)] {
        assert_eq!(read(&bytes), table);
    }
    let [ball, chamfer, spot, thread] = &table.tools[..] else { panic!("{table:?}") };
    assert_eq!((&*ball.name, ball.number), ("6 mm ball & long", Some(4)));
    assert_eq!(ball.assembly.stick_out_mm(), 45.0);
    let json = r#"{"type": "ball end mill", "description": "6 mm ball & long", "unit": "millimeters",
        "geometry": {"DC": 6, "RE": 3, "LCF": 12, "LB": 45, "OAL": 80, "SFDM": 6, "shoulder-length": 30},
        "holder": {"description": "ER20", "unit": "millimeters", "gaugeLength": 40, "segments": [
            {"height": 8, "lower-diameter": 28, "upper-diameter": 34},
            {"height": 22, "lower-diameter": 34, "upper-diameter": 34},
            {"height": 30, "lower-diameter": 40, "upper-diameter": 40}]},
        "post-process": {"number": 4}}"#;
    let same = from_bytes(json.as_bytes(), "shop.json".as_ref(), &library()).unwrap();
    assert_eq!(&same.tools[0], ball);
    // Per side of a chamfer mill, of the whole point of a spot drill.
    assert_eq!(radii(chamfer, [1.0, 3.175, 20.0]), [1.0, 3.175, 3.175]);
    assert_eq!(radii(spot, [1.0, 3.0, 14.0]), [1.0, 3.0, 3.5]);
    assert_eq!((&*spot.name, &*thread.name), ("SD6", "Ø M6 é"));
    assert_eq!(radii(thread, [0.5, 1.5, 10.0]), [2.25, 2.25, 1.7]);
    let words = [
        "does not say the diameter of the shank",
        "tool \"odd\": diameter is \"wide\", not a number",
        "tool \"none\": diameter, the diameter, is missing",
    ];
    for (refused, words) in table.refused.iter().zip(words) {
        assert!(refused.contains(words), "{refused}");
    }
    assert_eq!(table.refused.len(), 3);
    let one = SHOP.split("  <tool type=\"chamfer").next().unwrap().to_string() + "</tool-library>";
    let holder =
        holder_from_bytes(one.as_bytes(), "h.hsmlib".as_ref(), &MissingParameters::default())
            .unwrap();
    assert_eq!((&*holder.name, holder.sections.len()), ("ER20", 3));
}

#[test]
fn other_xml_and_what_is_cut_off_are_called_that() {
    for (text, words) in [
        ("<svg width=\"3\"/>", "its outermost tag is \"svg\""),
        ("<!DOCTYPE html><html></html>", "it is a web page"),
        ("T1 D6", "the file is not XML"),
        ("<tool-library><tool type=\"drill\">", "ends before its tools do"),
        ("<tool-library><tool></tool-library>", "the XML cannot be read"),
        ("<tool-library></tool-library>", "no tool can be used"),
        ("<tool-library><tool><body/></tool></tool-library>", "its type is missing"),
    ] {
        let message = from_bytes(text.as_bytes(), "x.hsmlib".as_ref(), &library()).unwrap_err();
        let message = message.to_string();
        assert!(message.starts_with("x.hsmlib: ") && message.contains(words), "{message}");
        assert!(message.contains("; ") && !message.contains('\n'), "{message}");
    }
    // Entities of a document type are not expanded, and tags may be nested as deep as they like.
    let bomb = "<!DOCTYPE a [<!ENTITY a \"&a;&a;\">]><tool-library><tool type=\"&a;\"><description>&a;</description>";
    for text in [bomb.to_string(), format!("<tool-library>{}", "<a>".repeat(100_000))] {
        let message = from_bytes(text.as_bytes(), "x.hsmlib".as_ref(), &library()).unwrap_err();
        assert!(message.to_string().contains("ends before its tools do"), "{message}");
    }
    for cut in 0..SHOP.len() {
        if let Some(part) = SHOP.get(..cut) {
            let _ = from_bytes(part.as_bytes(), "x.hsmlib".as_ref(), &library());
        }
    }
}
