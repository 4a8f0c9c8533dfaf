//! `monadnock tree`: sparse construction trees, fitted to terrain, edited as text, and drawn.

use super::Context;
use super::args::DemInput;
use super::outputs::{OutputKind, Outputs};
use crate::dem::io::{self, WriteOptions};
use crate::error::{Error, Result};
use crate::file;
use crate::sparse::tree::{AtomSource, FitConfig, Node, NoiseKind, Pair, Tree, fit, numbers};
use std::path::{Path, PathBuf};

const EXAMPLES: &str = "\
Examples:
  monadnock tree fit alps.tif -o alps.toml --atoms 128 --sparsity 2
  monadnock tree fit alps.tif -o noise.toml --source ridged --step 5
  monadnock tree edit alps.toml --carve river.toml -o with-river.toml
  monadnock tree render with-river.toml -o fine.tif --cell 10 --window 0,0,4000,3000
  monadnock tree info with-river.toml

A tree is a text of operators and primitives (TOML) and, beside it under the same name, the numbers of its sparse primitives
(.safetensors). Places are metres east and south of the north-west corner. A node that is carved, such as river.toml:

  kind = \"curve\"
  points = [[0.0, 800.0, 410.0], [900.0, 1100.0, 395.0]]
  section = [[0.0, -6.0], [25.0, 0.0]]
  reach = 80.0

Other kinds: plane, noise, disc, blend, replace, carve, add. A tree has no place on the Earth: what is drawn lies at its own corner.";

/// Arguments of `tree`.
#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct TreeArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(clap::Subcommand)]
enum Action {
    /// Represent terrain as sparse sums of a few forms, or of noise functions
    Fit(FitArgs),
    /// Put an operator and a node on top of a tree
    Edit(EditArgs),
    /// Draw a tree as terrain, with cells of any size
    Render(RenderArgs),
    /// Say what a tree is made of
    Info(InfoArgs),
}

#[derive(clap::Args)]
struct FitArgs {
    #[command(flatten)]
    dem: DemInput,
    /// The tree to write
    #[arg(short, long, value_name = "TREE.toml")]
    output: PathBuf,
    /// Number of forms; 0 with noise takes every function that is used
    #[arg(long, default_value_t = 128)]
    atoms: usize,
    /// Forms of a disc
    #[arg(long, default_value_t = 1)]
    sparsity: usize,
    /// Radius of a disc, cells
    #[arg(long, default_value_t = 5.0)]
    radius: f64,
    /// Cells from disc to disc
    #[arg(long, default_value_t = 6)]
    step: usize,
    /// Where forms come from: learned (K-SVD), patches of the terrain, or noise functions
    #[arg(long, default_value = "learned", value_parser = ["learned", "patches", "perlin", "ridged", "ridged-multifractal"])]
    source: String,
    /// Metres to which heights are rounded in the file [default: a five-thousandth of the relief]
    #[arg(long, value_name = "METRES")]
    precision: Option<f64>,
    /// Most rounds of learning
    #[arg(long, default_value_t = 20)]
    rounds: usize,
}

#[derive(clap::Args)]
struct EditArgs {
    /// The tree
    tree: PathBuf,
    #[command(flatten)]
    operator: OperatorArgs,
    /// How strong: 0 not at all, 1 whole
    #[arg(long, default_value_t = 1.0)]
    weight: f64,
    /// The tree to write
    #[arg(short, long, value_name = "TREE.toml")]
    output: PathBuf,
}

#[derive(clap::Args)]
#[group(required = true, multiple = false)]
struct OperatorArgs {
    /// A file with the node that lowers the terrain
    #[arg(long, value_name = "NODE.toml")]
    carve: Option<PathBuf>,
    /// A file with the node that is added to it
    #[arg(long, value_name = "NODE.toml")]
    add: Option<PathBuf>,
    /// A file with the node that takes its place
    #[arg(long, value_name = "NODE.toml")]
    replace: Option<PathBuf>,
}

#[derive(clap::Args)]
struct RenderArgs {
    /// The tree
    tree: PathBuf,
    /// The terrain to write
    #[arg(short, long)]
    output: PathBuf,
    /// Metres of a cell [default: the tree's own]
    #[arg(long, value_name = "METRES")]
    cell: Option<f64>,
    /// Part of it: west, north, width and height in metres
    #[arg(long, value_name = "X,Y,W,H", value_parser = window)]
    window: Option<[f64; 4]>,
}

#[derive(clap::Args)]
struct InfoArgs {
    /// The tree
    tree: PathBuf,
}

fn window(text: &str) -> Result<[f64; 4], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    let whole = numbers.and_then(|n| <[f64; 4]>::try_from(n).ok());
    whole.filter(|n| n.iter().all(|v| v.is_finite())).ok_or_else(|| "allowed: X,Y,W,H in metres".to_owned())
}

/// Runs the verb.
///
/// # Errors
/// Whatever is wrong with the terrain, the tree or the output path.
pub(super) fn run(args: &TreeArgs, context: &Context) -> Result<()> {
    match &args.action {
        Action::Fit(args) => fit_terrain(args, context),
        Action::Edit(args) => edit(args, context),
        Action::Render(args) => render(args, context),
        Action::Info(args) => info(&args.tree, context),
    }
}

fn fit_terrain(args: &FitArgs, context: &Context) -> Result<()> {
    let beside = numbers(&args.output);
    Outputs::new()
        .writes("--output", &args.output, OutputKind::Toml)
        .writes("--output", &beside, OutputKind::Style)
        .reads(&args.dem.dem)
        .check()?;
    let dem = args.dem.load(&context.console)?;
    if dem.georeference().is_some() {
        context.console.note(format!("{}: a tree has no place on the Earth", args.output.display()));
    }
    let (low, high) = dem.range();
    let relief = f64::from(high - low);
    let precision = args.precision.unwrap_or((relief / 5000.0).max(1e-6));
    if !(precision > 0.0 && precision.is_finite()) {
        return Err(Error::value("--precision", precision, "allowed: above 0"));
    }
    let source = match args.source.as_str() {
        "patches" => AtomSource::Patches,
        "perlin" => AtomSource::Noise(NoiseKind::Perlin),
        "ridged" => AtomSource::Noise(NoiseKind::Ridged),
        "ridged-multifractal" => AtomSource::Noise(NoiseKind::RidgedMultifractal),
        _ => AtomSource::Learned,
    };
    let FitArgs { atoms, sparsity, radius, step, rounds, .. } = *args;
    let config = FitConfig { atoms, sparsity, radius, step, source, rounds };
    let bar = context.console.progress(rounds as u64, "learning forms");
    let field = fit(&dem, &config, context.seed, &context.stop(), &mut |round, error| {
        bar.note(format!("error {error:.4}"));
        bar.reach(round as u64);
    })?;
    drop(bar);
    let counted = field.values();
    let tree = Tree::of(field);
    let bytes = tree.write(&args.output, precision)?;
    // As it was written.
    let drawn = Tree::read(&args.output)?.render(tree.cell(), None, &context.stop())?;
    let error = crate::metrics::rmse(drawn.heights(), dem.heights(), dem.valid())?;
    let cells = dem.heights().len() as f64;
    context.console.line(format!(
        "{}: {:.2} m off in the mean (PSNR {:.1} dB); {:.1} % of the values by the paper's count, {bytes} bytes with {}: {:.1} % of 4 bytes a cell",
        args.output.display(),
        error,
        20.0 * (relief / error.max(f64::MIN_POSITIVE)).log10(),
        100.0 * counted as f64 / cells,
        beside.display(),
        100.0 * bytes as f64 / (4.0 * cells),
    ));
    Ok(())
}

fn edit(args: &EditArgs, context: &Context) -> Result<()> {
    let (path, operator): (&PathBuf, fn(Pair) -> Node) =
        match (&args.operator.carve, &args.operator.add, &args.operator.replace) {
            (Some(path), _, _) => (path, Node::Carve),
            (_, Some(path), _) => (path, Node::Add),
            (_, _, Some(path)) => (path, Node::Replace),
            _ => return Err(Error::value("operator", "none", "allowed: --carve, --add or --replace")),
        };
    Outputs::new()
        .writes("--output", &args.output, OutputKind::Toml)
        .writes("--output", &numbers(&args.output), OutputKind::Style)
        .reads(&args.tree)
        .reads(path)
        .check()?;
    let tree = Tree::read(&args.tree)?;
    let by: Node = read_node(path)?;
    let root =
        operator(Pair { weight: args.weight, terrain: Box::new(tree.root().clone()), by: Box::new(by) });
    let edited = tree.with_root(root).map_err(|e| e.in_file(path))?;
    let text = edited.text_of()?;
    file::write_bytes(&numbers(&args.output), &file::read_whole(&numbers(&args.tree), u64::MAX)?)?;
    file::write_bytes(&args.output, text.as_bytes())?;
    context.console.line(format!("{}: {}", args.output.display(), outline(edited.root())));
    Ok(())
}

fn read_node(path: &Path) -> Result<Node> {
    let text = file::read_text(path, 1 << 26)?;
    toml::from_str(&text).map_err(|e| {
        Error::file(
            path,
            "node",
            e.to_string().trim_end(),
            "allowed: a node, as `monadnock tree --help` shows",
        )
    })
}

fn render(args: &RenderArgs, context: &Context) -> Result<()> {
    Outputs::new().writes("--output", &args.output, OutputKind::Terrain).reads(&args.tree).check()?;
    let tree = Tree::read(&args.tree)?;
    let dem = tree.render(args.cell.unwrap_or(tree.cell()), args.window, &context.stop())?;
    io::write(&dem, &args.output, &WriteOptions::default())?;
    let ((rows, cols), (low, high)) = (dem.shape(), dem.range());
    context.console.line(format!("{}: {rows}x{cols} cells, {low:.1} to {high:.1} m", args.output.display()));
    Ok(())
}

fn info(path: &Path, context: &Context) -> Result<()> {
    let tree = Tree::read(path)?;
    let [width, height] = tree.extent();
    context.console.result(format!("{}: {width} x {height} m, cells of {} m", path.display(), tree.cell()));
    context.console.result(format!("  {}", outline(tree.root())));
    for (name, field) in tree.fields() {
        let (rows, cols) = field.shape;
        context.console.result(format!(
            "  {name}: {rows}x{cols} cells of {} m; {} primitives of radius {} every {} cells; {} data atoms, {} functions, \
             {} used; {} values by the paper's count, {:.1} % of the cells",
            field.cell,
            field.means.len(),
            field.disc.radius(),
            field.disc.step(),
            field.grids.len(),
            field.functions.len(),
            field.codes.count(),
            field.values(),
            100.0 * field.values() as f64 / (rows * cols) as f64,
        ));
    }
    Ok(())
}

/// A tree in one line.
fn outline(node: &Node) -> String {
    let below: Vec<String> = node.children().into_iter().map(outline).collect();
    match below.as_slice() {
        [] => node.kind().to_owned(),
        below => format!("{}({})", node.kind(), below.join(", ")),
    }
}
