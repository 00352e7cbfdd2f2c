fn main() {
    println!("{}", deepmill_wasm::digest());
}
