//! The list of linked libraries for other programs: CycloneDX 1.5, <https://cyclonedx.org/docs/1.5/json/>.

use anyhow::{Context, Result};
use cargo_metadata::Package;
use cyclonedx_bom::external_models::spdx::SpdxExpression;
use cyclonedx_bom::models::bom::Bom;
use cyclonedx_bom::models::component::{Classification, Component, Components};
use cyclonedx_bom::models::license::{LicenseChoice, Licenses};
use cyclonedx_bom::prelude::Purl;

/// The list as JSON. It has no serial number and no time: so two runs are equal.
///
/// # Errors
/// A package has a name that no package address can hold.
pub fn json(packages: &[Package]) -> Result<Vec<u8>> {
    let components = packages.iter().map(component).collect::<Result<Vec<_>>>()?;
    let bom = Bom {
        serial_number: None,
        components: Some(Components(components)),
        ..Bom::default()
    };
    let mut out = Vec::new();
    bom.output_as_json_v1_5(&mut out)
        .context("the list of libraries cannot be written as CycloneDX")?;
    Ok(out)
}

fn component(package: &Package) -> Result<Component> {
    let (name, version) = (package.name.as_str(), package.version.to_string());
    let mut component = Component::new(Classification::Library, name, &version, None);
    let address = Purl::new("cargo", name, &version);
    component.purl =
        Some(address.with_context(|| format!("{name} {version} has no package address"))?);
    // Older packages separate licences by a slash.
    let licence = package
        .license
        .as_ref()
        .map(|licence| licence.replace('/', " OR "));
    component.licenses = licence
        .and_then(|licence| SpdxExpression::try_from(licence).ok())
        .map(|licence| Licenses(vec![LicenseChoice::Expression(licence)]));
    Ok(component)
}
