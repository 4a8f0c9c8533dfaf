//! What the names of scores say: how they are read, written and compared.

/// Whether less of a score is better, which its name tells: an error, a loss, a distance, a difference, a share of faults.
#[must_use]
pub(crate) fn lower_is_better(metric: &str) -> bool {
    let name = metric.strip_prefix("train_").unwrap_or(metric);
    let faults = ["_distance", "_difference", "_error", "_share"];
    name == "rmse" || name.starts_with("l_") || faults.iter().any(|end| name.ends_with(end))
}

/// The name of a score with its unit and how it is to be read.
pub(crate) fn title(metric: &str) -> String {
    let words = match metric {
        "ssim" => "SSIM",
        "psnr" => "PSNR, dB",
        "interior_ssim" => "SSIM without the 8-cell border",
        "interior_psnr" => "PSNR without the 8-cell border, dB",
        "border_psnr" => "PSNR of the 8-cell border, dB",
        "rmse" => "root mean square error, unit heights",
        "mean_slope_ratio" => "mean slope over the true one (1 is right)",
        "spectrum_distance" => "distance of the spectra, dB",
        other => return other.replace('_', " "),
    };
    words.to_owned()
}

/// Digits behind the point.
pub(crate) fn decimals(metric: &str) -> usize {
    match metric {
        m if m.ends_with("psnr") || m == "spectrum_distance" => 2,
        m if m.contains("l_g") || m.ends_with("_difference") => 6,
        _ => 4,
    }
}
