// SPDX-License-Identifier: Apache-2.0
// Writes the files of this release: golden.make tests/golden/protocol_2_0. Once, when the protocol
// gets a new version; those of earlier versions stay as they are.
#include <zlib.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "agent/spool/disk/disk_spool.h"
#include "server/store/factory/open_store.h"
#include "tests/golden/golden_content.h"

namespace rigcal::testing {
namespace {

namespace fs = std::filesystem;

std::string ReadBytes(const fs::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

bool WriteBytes(const fs::path& path, const std::string& bytes) {
  std::ofstream stream(path, std::ios::binary);
  stream << bytes;
  stream.close();
  return static_cast<bool>(stream);
}

bool Compress(const fs::path& from, const fs::path& to) {
  const std::string bytes = ReadBytes(from);
  const gzFile file = gzopen(to.c_str(), "wb9");
  if (file == nullptr) return false;
  const int size = static_cast<int>(bytes.size());
  const bool written = gzwrite(file, bytes.data(), static_cast<unsigned>(size)) == size;
  return gzclose(file) == Z_OK && written;
}

bool MakeStore(const fs::path& scratch, const fs::path& folder) {
  {
    const auto store = server::OpenStore(scratch.string(), {.min_free_bytes = 0});
    if (!store.ok() || !FillGoldenStore(store->get()).ok()) return false;
  }
  return Compress(scratch / "rigcal.db", folder / "rigcal.db.gz");
}

bool MakeSpool(const fs::path& scratch, const fs::path& folder) {
  {
    agent::DiskSpoolOptions options;
    options.folder = scratch.string();
    const auto spool = agent::DiskSpool::Create(options);
    if (!spool.ok() || !FillGoldenSpool(spool->get()).ok()) return false;
    (*spool)->Shutdown();
  }
  bool ok = true;
  fs::create_directories(folder / "spool");
  for (const auto& entry : fs::directory_iterator(scratch)) {
    const fs::path name = entry.path().filename();
    if (name.extension() == ".seg" || name == "checkpoint") {
      ok &= WriteBytes(folder / "spool" / name, ReadBytes(entry.path()));
    }
  }
  return ok;
}

bool MakeAll(const fs::path& folder) {
  const fs::path scratch = folder / "scratch";
  fs::create_directories(folder / "messages");
  bool ok = MakeStore(scratch / "store", folder) && MakeSpool(scratch / "spool", folder);
  for (const auto& [name, bytes] : GoldenMessages()) {
    ok &= WriteBytes(folder / "messages" / name, bytes);
  }
  fs::remove_all(scratch);
  return ok;
}

}  // namespace
}  // namespace rigcal::testing

int main(int argc, char** argv) {
  if (argc == 2 && rigcal::testing::MakeAll(argv[1])) return 0;
  std::fprintf(stderr, "cannot write; name an empty folder: golden.make FOLDER\n");
  return 1;
}
