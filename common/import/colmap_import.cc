// SPDX-License-Identifier: Apache-2.0
// A COLMAP model (COLMAP's documentation, "Output format" and "Camera models"): each image is a
// camera, called like the image. Poses are cam_from_world; the centre of the first pixel is
// (0.5, 0.5).
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <span>
#include <system_error>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/import/convention.h"
#include "common/import/import_readers.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr size_t kMostColmapBytes = size_t{256} << 20;  // images has the points of each image
constexpr double kColmapFirstPixel = 0.5;

// Where each of a model's parameters goes: f is both focal lengths, 0 to 7 a coefficient.
struct ColmapLensModel {
  const char* name;
  int id;
  bool one_focal;
  bool fisheye;
  std::vector<int> coefficients;  // OpenCV's number of each
};

const std::vector<ColmapLensModel>& ColmapLensModels() {
  static const auto* const kModels =
      new std::vector<ColmapLensModel>{{"SIMPLE_PINHOLE", 0, true, false, {}},
                                       {"PINHOLE", 1, false, false, {}},
                                       {"SIMPLE_RADIAL", 2, true, false, {0}},
                                       {"RADIAL", 3, true, false, {0, 1}},
                                       {"OPENCV", 4, false, false, {0, 1, 2, 3}},
                                       {"OPENCV_FISHEYE", 5, false, true, {0, 1, 2, 3}},
                                       {"FULL_OPENCV", 6, false, false, {0, 1, 2, 3, 4, 5, 6, 7}},
                                       {"SIMPLE_RADIAL_FISHEYE", 8, true, true, {0}},
                                       {"RADIAL_FISHEYE", 9, true, true, {0, 1}}};
  return *kModels;
}

size_t ParameterCount(const ColmapLensModel& model) {
  return (model.one_focal ? 3u : 4u) + model.coefficients.size();
}

ImportedCamera LensOfColmap(const ColmapLensModel& model, uint64_t width, uint64_t height,
                            std::span<const double> p) {
  ImportedCamera camera;
  const auto side = [](uint64_t value) {
    return value <= kMaxImageSidePx ? static_cast<uint32_t>(value) : 0;
  };
  camera.image_size_px = {side(width), side(height)};
  Intrinsics& k = camera.intrinsics;
  const size_t first = model.one_focal ? 1 : 2;
  k.fx_px = p[0], k.fy_px = p[first - 1];
  k.cx_px = p[first] - kColmapFirstPixel, k.cy_px = p[first + 1] - kColmapFirstPixel;
  k.model = model.fisheye                     ? DistortionModel::kFisheye
            : model.coefficients.size() == 8u ? DistortionModel::kRational
                                              : DistortionModel::kBrownConrady;
  k.distortion.assign(static_cast<size_t>(CoefficientCount(k.model)), 0.0);
  for (size_t i = 0; i < model.coefficients.size(); ++i) {
    k.distortion[static_cast<size_t>(model.coefficients[i])] = p[first + 2 + i];
  }
  // FULL_OPENCV is also how a lens with k3 alone is written.
  if (k.model == DistortionModel::kRational && k.distortion[5] == 0 && k.distortion[6] == 0 &&
      k.distortion[7] == 0) {
    k.model = DistortionModel::kBrownConrady;
    k.distortion.resize(5);
  }
  return camera;
}

// The lenses of a model by their number, and a rig as it is filled.
struct ColmapReader {
  std::map<uint32_t, absl::StatusOr<ImportedCamera>> lenses;
  ImportedRig rig{"COLMAP", {}, {}};

  // pose: qw qx qy qz tx ty tz.
  void AddImage(const std::string& path, int line, std::span<const double> pose, uint32_t lens,
                const std::string& image) {
    const std::string name =
        CameraNameFrom(std::filesystem::path(image).replace_extension().string());
    rig.Add(name, [&]() -> absl::StatusOr<ImportedCamera> {
      const auto found = lenses.find(lens);
      if (found == lenses.end()) {
        return ImportError(path, line,
                           absl::StrCat("image ", name, " is of camera ", lens,
                                        ", which the file of cameras does not have"));
      }
      RIGCAL_ASSIGN_OR_RETURN(ImportedCamera camera, found->second);
      camera.name = name;
      const Eigen::Quaterniond q(pose[0], pose[1], pose[2], pose[3]);
      if (!(std::abs(q.norm() - 1) < 1e-3)) {
        return ImportError(path, line, absl::StrCat("image ", name, " has no unit quaternion"));
      }
      camera.cam_from_rig = RigidTransform(q.normalized(), Eigen::Vector3d(&pose[4]));
      RIGCAL_RETURN_IF_ERROR(CheckImported(path, line, camera));
      return camera;
    }());
  }
};

absl::Status NumbersOfWords(const std::string& path, int line,
                            std::span<const absl::string_view> words, std::vector<double>* values) {
  values->clear();
  for (const absl::string_view word : words) {
    double value = NAN;
    if (!absl::SimpleAtod(word, &value) || !std::isfinite(value)) {
      return ImportError(path, line, "has a value that is not a finite number");
    }
    values->push_back(value);
  }
  return absl::OkStatus();
}

std::vector<absl::string_view> WordsOf(absl::string_view line) {
  return absl::StrSplit(line, absl::ByAnyChar(" \t\r"), absl::SkipEmpty());
}

absl::Status ReadColmapCamerasText(const std::string& path, const std::string& text,
                                   ColmapReader* reader) {
  int line = 0;
  for (const absl::string_view row : absl::StrSplit(text, '\n')) {
    ++line;
    const std::vector<absl::string_view> words = WordsOf(row);
    if (words.empty() || words[0].front() == '#') continue;
    uint32_t id = 0;
    uint64_t width = 0, height = 0;
    if (words.size() < 5 || !absl::SimpleAtoi(words[0], &id) ||
        !absl::SimpleAtoi(words[2], &width) || !absl::SimpleAtoi(words[3], &height)) {
      return ImportError(path, line, "is not CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]");
    }
    reader->lenses.insert_or_assign(id, [&]() -> absl::StatusOr<ImportedCamera> {
      for (const ColmapLensModel& model : ColmapLensModels()) {
        if (words[1] != model.name) continue;
        std::vector<double> parameters;
        RIGCAL_RETURN_IF_ERROR(NumbersOfWords(
            path, line, std::span<const absl::string_view>(words).subspan(4), &parameters));
        if (parameters.size() != ParameterCount(model)) {
          return ImportError(path, line,
                             absl::StrCat(model.name, " has ", ParameterCount(model),
                                          " parameters, not ", parameters.size()));
        }
        return LensOfColmap(model, width, height, parameters);
      }
      return ImportError(
          path, line,
          absl::StrCat("the lens model ", words[1].substr(0, 40), " is none that rigcal has"));
    }());
  }
  return absl::OkStatus();
}

absl::Status ReadColmapImagesText(const std::string& path, const std::string& text,
                                  ColmapReader* reader) {
  int line = 0;
  bool points = false;  // every other line has the points of the image before, and may be empty
  for (const absl::string_view row : absl::StrSplit(text, '\n')) {
    ++line;
    const std::vector<absl::string_view> words = WordsOf(row);
    if (points) {
      points = false;
      continue;
    }
    if (words.empty() || words[0].front() == '#') continue;
    points = true;
    uint32_t lens = 0;
    if (words.size() < 10 || !absl::SimpleAtoi(words[8], &lens)) {
      return ImportError(path, line, "is not IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME");
    }
    std::vector<double> pose;
    RIGCAL_RETURN_IF_ERROR(
        NumbersOfWords(path, line, std::span<const absl::string_view>(words).subspan(1, 7), &pose));
    reader->AddImage(path, line, pose, lens, std::string(words[9]));
  }
  return absl::OkStatus();
}

// Numbers of a little-endian file, until it ends.
class ColmapBytes {
 public:
  explicit ColmapBytes(absl::string_view bytes) : bytes_(bytes) {}

  template <typename Number>
  Number Take() {
    Number value{};
    if (bytes_.size() < sizeof value) {
      short_ = true;
      return value;
    }
    static_assert(std::endian::native == std::endian::little);
    std::memcpy(&value, bytes_.data(), sizeof value);
    bytes_.remove_prefix(sizeof value);
    return value;
  }
  std::vector<double> Doubles(size_t count) {
    std::vector<double> values(count);
    for (double& value : values) value = Take<double>();
    return values;
  }
  std::string Text() {
    const size_t end = bytes_.find('\0');
    if (end == absl::string_view::npos) {
      short_ = true;
      return "";
    }
    std::string text(bytes_.substr(0, end));
    bytes_.remove_prefix(end + 1);
    return text;
  }
  void Skip(uint64_t count, size_t bytes_each) {
    if (count > bytes_.size() / bytes_each) {
      short_ = true;
      return;
    }
    bytes_.remove_prefix(static_cast<size_t>(count) * bytes_each);
  }
  bool is_short() const { return short_; }

 private:
  absl::string_view bytes_;
  bool short_ = false;
};

absl::Status ReadColmapCamerasBinary(const std::string& path, const std::string& bytes,
                                     ColmapReader* reader) {
  ColmapBytes in(bytes);
  const auto count = in.Take<uint64_t>();
  for (uint64_t i = 0; i < count && !in.is_short(); ++i) {
    const auto id = in.Take<uint32_t>();
    const auto model_id = in.Take<int32_t>();
    const auto width = in.Take<uint64_t>(), height = in.Take<uint64_t>();
    const ColmapLensModel* model = nullptr;
    for (const ColmapLensModel& known : ColmapLensModels()) {
      if (known.id == model_id) model = &known;
    }
    // How many parameters another model has is not known, so that nothing behind it can be read.
    if (model == nullptr) {
      return ImportError(path, 0,
                         absl::StrCat("camera ", id, " has the lens model number ", model_id,
                                      ", which is none that rigcal has"));
    }
    reader->lenses.insert_or_assign(
        id, LensOfColmap(*model, width, height, in.Doubles(ParameterCount(*model))));
  }
  return in.is_short() ? ImportError(path, 0, "ends within a camera") : absl::OkStatus();
}

absl::Status ReadColmapImagesBinary(const std::string& path, const std::string& bytes,
                                    ColmapReader* reader) {
  ColmapBytes in(bytes);
  const auto count = in.Take<uint64_t>();
  for (uint64_t i = 0; i < count && !in.is_short(); ++i) {
    in.Take<uint32_t>();
    const std::vector<double> pose = in.Doubles(7);
    const auto lens = in.Take<uint32_t>();
    const std::string name = in.Text();
    in.Skip(in.Take<uint64_t>(), 2 * sizeof(double) + sizeof(uint64_t));
    if (!in.is_short()) reader->AddImage(path, 0, pose, lens, name);
  }
  return in.is_short() ? ImportError(path, 0, "ends within an image") : absl::OkStatus();
}

bool HasColmapFiles(const std::filesystem::path& folder, const char* end) {
  std::error_code error;
  return std::filesystem::is_regular_file(folder / (std::string("cameras") + end), error) &&
         std::filesystem::is_regular_file(folder / (std::string("images") + end), error);
}

}  // namespace

bool IsColmapFolder(const std::filesystem::path& folder) {
  return HasColmapFiles(folder, ".txt") || HasColmapFiles(folder, ".bin");
}

absl::StatusOr<ImportedRig> ReadColmap(const std::filesystem::path& folder) {
  const bool binary = !HasColmapFiles(folder, ".txt");
  const std::string end = binary ? ".bin" : ".txt";
  const std::string camera_path = (folder / ("cameras" + end)).string();
  const std::string image_path = (folder / ("images" + end)).string();
  RIGCAL_ASSIGN_OR_RETURN(const std::string cameras, ReadImportText(camera_path, kMostColmapBytes));
  RIGCAL_ASSIGN_OR_RETURN(const std::string images, ReadImportText(image_path, kMostColmapBytes));
  ColmapReader reader;
  RIGCAL_RETURN_IF_ERROR(
      (binary ? ReadColmapCamerasBinary : ReadColmapCamerasText)(camera_path, cameras, &reader));
  RIGCAL_RETURN_IF_ERROR(
      (binary ? ReadColmapImagesBinary : ReadColmapImagesText)(image_path, images, &reader));
  ImportedRig& rig = reader.rig;
  RIGCAL_RETURN_IF_ERROR(CheckNames(image_path, rig));
  RecogniseConvention(&rig);
  // COLMAP itself knows no metres; what rigcal exports says them.
  if (binary || cameras.find(", metres") == std::string::npos) {
    rig.notes.push_back("COLMAP's files say no unit of length; metres are taken for granted");
  }
  return std::move(rig);
}

}  // namespace rigcal
