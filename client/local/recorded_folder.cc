// SPDX-License-Identifier: Apache-2.0
#include "client/local/recorded_folder.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <set>
#include <string_view>
#include <system_error>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/import/intrinsics_file.h"
#include "common/status/fault_list.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"
#include "common/target/csv_layout.h"

namespace rigcal::client {
namespace {

namespace fs = std::filesystem;

constexpr char kLayout[] =
    "a recorded rig is a folder with <camera>.csv (markers), <camera>.raw, .h5 or .hdf5 (events), "
    "a folder <camera> of images or a video <camera>.mp4, and <camera>.yaml (intrinsics; .yml, "
    ".xml "
    "and .json, too) for each camera";

struct Listing {
  std::map<std::string, std::set<std::string>> recordings;  // file names, by stem
  std::map<std::string, std::set<std::string>> frames;      // folders of images and videos
  std::set<std::string> yaml;                               // stems of .yaml
};

constexpr std::string_view kEventEndings[] = {".raw", ".h5", ".hdf5"};
constexpr std::string_view kVideoEndings[] = {".mp4", ".mkv",  ".avi", ".mov",
                                              ".m4v", ".webm", ".mpg"};
constexpr std::string_view kImageEndings[] = {".png", ".jpg",  ".jpeg", ".bmp",
                                              ".tif", ".tiff", ".pgm",  ".webp"};

template <size_t kCount>
bool EndsWithOneOf(const fs::path& file, const std::string_view (&endings)[kCount]) {
  return std::ranges::find(endings, absl::AsciiStrToLower(file.extension().string())) !=
         std::end(endings);
}

bool IsEventFile(const fs::path& file) { return EndsWithOneOf(file, kEventEndings); }

bool HasImages(const fs::path& folder) {
  std::error_code error;
  fs::directory_iterator entry(folder, error);
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    if (EndsWithOneOf(entry->path(), kImageEndings)) return true;
  }
  return false;
}

RecordingKind KindOf(const fs::path& recording) {
  std::error_code error;
  if (IsEventFile(recording)) return RecordingKind::kEvents;
  if (fs::is_directory(recording, error)) return RecordingKind::kImages;
  return EndsWithOneOf(recording, kVideoEndings) ? RecordingKind::kVideo : RecordingKind::kMarkers;
}

absl::StatusOr<Listing> List(const fs::path& folder) {
  std::error_code error;
  const fs::file_status status = fs::status(folder, error);
  if (!fs::exists(status)) {
    return absl::NotFoundError(absl::StrCat("there is no folder ", folder.string(), "; ", kLayout));
  }
  if (!fs::is_directory(status)) {
    return absl::InvalidArgumentError(absl::StrCat(folder.string(), " is not a folder; ", kLayout));
  }
  Listing listing;
  fs::directory_iterator entry(folder, error);
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    const fs::path file = entry->path();
    const std::string stem = file.stem().string();
    // Hidden files are left by editors and file systems ("._left.csv").
    if (stem.empty() || stem.front() == '.') continue;
    if (absl::AsciiStrToLower(file.extension().string()) == ".csv" || IsEventFile(file)) {
      listing.recordings[stem].insert(file.filename().string());
    }
    const bool is_folder = fs::is_directory(file, error);
    if (is_folder ? HasImages(file) : EndsWithOneOf(file, kVideoEndings)) {
      listing.frames[is_folder ? file.filename().string() : stem].insert(file.filename().string());
    }
    if (file.extension() == ".yaml") listing.yaml.insert(stem);
  }
  if (error) {
    return absl::FailedPreconditionError(
        absl::StrCat("cannot read the folder ", folder.string(), ": ", error.message()));
  }
  return listing;
}

// `unused`: the lens files that belong to no recording, as text; empty: there are none.
void CheckCamera(const RecordedCamera& camera, const std::string& unused, FaultList* faults) {
  const std::string yaml = LensFileBeside(camera.recording.string());
  std::error_code error;
  if (const absl::Status name = ValidateName("camera name", camera.camera); !name.ok()) {
    faults->Add(camera.recording.string(),
                ": a camera is named after its file: ", std::string(name.message()));
  } else if (!fs::exists(yaml, error)) {
    faults->Add("camera ", camera.camera, ": ", camera.recording.filename().string(),
                " is there, but ", yaml, " with its intrinsics is missing",
                unused.empty()
                    ? ""
                    : "; a lens file is named after its recording, and these belong to none: ",
                unused);
  } else if (const auto intrinsics = ReadIntrinsicsFile(yaml, camera.camera); !intrinsics.ok()) {
    faults->Add("camera ", camera.camera, ": ", std::string(intrinsics.status().message()));
  }
  if (camera.kind != RecordingKind::kMarkers) return;
  if (const auto layout = FindCsvLayoutOfFile(camera.recording.string()); !layout.ok()) {
    faults->Add("camera ", camera.camera, ": ", std::string(layout.status().message()));
  }
}

// No two lenses have the same calibration; without distortion it may have been made up for all.
void WarnOfCopiedLenses(RecordedFolder* folder) {
  std::vector<std::pair<std::string, Intrinsics>> lenses;  // by camera
  for (const RecordedCamera& camera : folder->cameras) {
    const auto lens = ReadIntrinsicsFile(LensFileBeside(camera.recording.string()), camera.camera);
    if (!lens.ok() ||
        std::ranges::all_of(lens->intrinsics.distortion, [](double k) { return k == 0; })) {
      continue;
    }
    const auto same =
        std::ranges::find(lenses, lens->intrinsics, &std::pair<std::string, Intrinsics>::second);
    if (same != lenses.end()) {
      folder->warnings.push_back(absl::StrCat("cameras ", same->first, " and ", camera.camera,
                                              " have the same intrinsics, to the last digit: one "
                                              "lens file is a copy of the other; give "
                                              "each camera its own"));
    }
    lenses.emplace_back(camera.camera, lens->intrinsics);
  }
}

}  // namespace

absl::StatusOr<RecordedFolder> ReadRecordedFolder(const fs::path& path) {
  RIGCAL_ASSIGN_OR_RETURN(const Listing listing, List(path));
  RecordedFolder folder;
  std::error_code error;
  folder.path = fs::absolute(path, error).lexically_normal();
  if (error) folder.path = path;

  FaultList faults;
  // Markers and events are taken where there are images as well: somebody has found them.
  std::map<std::string, std::set<std::string>> recordings = listing.recordings;
  for (const auto& [stem, files] : listing.frames) {
    const std::string lens = LensFileBeside((folder.path / *files.begin()).string());
    if (recordings.contains(stem)) continue;
    if (fs::exists(lens, error)) {
      recordings[stem] = files;
    } else {
      folder.warnings.push_back(absl::StrCat(*files.begin(), " shows images, but ", lens,
                                             " with the intrinsics of its camera is missing: no "
                                             "camera is made of it (rigcal-agent intrinsics "
                                             "makes such a file from pictures of a board)"));
    }
  }
  std::vector<std::string> unused;
  for (const std::string& stem : listing.yaml) {
    if (!recordings.contains(stem)) unused.push_back(absl::StrCat(stem, ".yaml"));
  }
  for (const auto& [stem, files] : recordings) {
    RecordedCamera camera{.camera = stem,
                          .recording = folder.path / *files.begin(),
                          .kind = KindOf(folder.path / *files.begin())};
    if (files.size() > 1) {
      faults.Add("camera ", stem, " has several recordings: ", absl::StrJoin(files, ", "),
                 "; leave one of them in ", path.string());
    }
    CheckCamera(camera, absl::StrJoin(unused, ", "), &faults);
    folder.cameras.push_back(std::move(camera));
  }
  for (const std::string& stem : listing.yaml) {
    if (recordings.contains(stem)) continue;
    folder.warnings.push_back(absl::StrCat(stem, ".yaml has no ", stem,
                                           ".csv, .raw, .h5 or .hdf5, no folder ", stem,
                                           " of images and no video beside it: no camera is made "
                                           "of it"));
  }
  if (folder.cameras.empty()) {
    faults.Add("there is no recording in ", path.string(), "; ", kLayout);
  } else if (folder.cameras.size() == 1) {
    faults.Add("there is only one camera in ", path.string(), " (", folder.cameras[0].camera,
               "); a rig needs at least two");
  }
  // Nobody is warned any more once it has failed, and one of these may be why.
  if (folder.cameras.size() < 2) {
    for (const std::string& warning : folder.warnings) faults.Add(warning);
  }
  RIGCAL_RETURN_IF_ERROR(faults.Result("", "\n"));
  WarnOfCopiedLenses(&folder);
  return folder;
}

}  // namespace rigcal::client
