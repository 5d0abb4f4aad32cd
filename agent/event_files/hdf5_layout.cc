// SPDX-License-Identifier: Apache-2.0
#include "agent/event_files/hdf5_layout.h"

#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "agent/event_files/sensor_geometry.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

// Whole microseconds that a double and 64 bits can hold with room for differences.
constexpr double kMaxOffsetUs = 4e18;

bool LinkExists(hid_t file, const std::string& path) {
  for (size_t end = path.find('/', 1);; end = path.find('/', end + 1)) {
    if (H5Lexists(file, path.substr(0, end).c_str(), H5P_DEFAULT) <= 0) return false;
    if (end == path.npos) return true;
  }
}

H5I_type_t ObjectType(hid_t file, const std::string& path) {
  if (!LinkExists(file, path)) return H5I_BADID;
  const Hdf5Handle object(H5Oopen(file, path.c_str(), H5P_DEFAULT), H5Oclose);
  return object.ok() ? H5Iget_type(object.get()) : H5I_BADID;
}

herr_t TakeName(hid_t, const char* name, const H5L_info_t*, void* names) {
  auto* const list = static_cast<std::vector<std::string>*>(names);
  list->push_back(absl::StrCat("/", name));
  return list->size() < 12 ? 0 : 1;
}

std::string WhatIsThere(hid_t file) {
  std::vector<std::string> names;
  H5Literate(file, H5_INDEX_NAME, H5_ITER_INC, nullptr, TakeName, &names);
  return names.empty() ? "nothing" : absl::StrJoin(names, ", ");
}

// `open` is given "x" and so on.
template <typename Open>
absl::StatusOr<Hdf5EventColumns> OpenColumns(Open open) {
  Hdf5EventColumns columns;
  for (const auto& [name, column] :
       {std::pair{"x", &columns.x}, {"y", &columns.y}, {"p", &columns.p}, {"t", &columns.t}}) {
    RIGCAL_ASSIGN_OR_RETURN(*column, open(name));
  }
  return columns;
}

absl::StatusOr<Hdf5EventColumns> OpenCompound(const std::string& path, hid_t file,
                                              const std::string& name) {
  RIGCAL_ASSIGN_OR_RETURN(const auto dataset, Hdf5Dataset::Open(path, file, name));
  return OpenColumns([&](const char* member) { return Hdf5Column::Create(dataset, member); });
}

absl::StatusOr<Hdf5Column> OpenColumn(const std::string& path, hid_t file,
                                      const std::string& name) {
  const std::string& found = LinkExists(file, name) ? name : absl::StrCat(name, "s");
  if (!LinkExists(file, found)) {
    return InvalidFile(
        path, ": there is no dataset ", name, " (nor ", found,
        "); the group /events needs x, y, p and t, or xs, ys, ps and ts, of one length");
  }
  RIGCAL_ASSIGN_OR_RETURN(const auto dataset, Hdf5Dataset::Open(path, file, found));
  return Hdf5Column::Create(dataset, "");
}

absl::StatusOr<Hdf5EventColumns> OpenGroup(const std::string& path, hid_t file) {
  RIGCAL_ASSIGN_OR_RETURN(Hdf5EventColumns columns, OpenColumns([&](const char* name) {
                            return OpenColumn(path, file, absl::StrCat("/events/", name));
                          }));
  std::vector<std::string> lengths;
  bool differ = false;
  for (const Hdf5Column* column : {&columns.x, &columns.y, &columns.p, &columns.t}) {
    lengths.push_back(absl::StrCat(column->Name(), " ", column->dataset().row_count));
    differ = differ || column->dataset().row_count != columns.x.dataset().row_count;
  }
  if (!differ) return columns;
  return InvalidFile(
      path, ": the columns have different lengths: ", absl::StrJoin(lengths, ", "),
      " rows; the file was not written to its end, or its parts are not of one recording");
}

absl::StatusOr<std::optional<Hdf5TriggerColumns>> OpenTriggers(const std::string& path,
                                                               hid_t file) {
  const std::string name = "/EXT_TRIGGER/events";
  if (ObjectType(file, name) != H5I_DATASET) return std::nullopt;
  RIGCAL_ASSIGN_OR_RETURN(const auto dataset, Hdf5Dataset::Open(path, file, name));
  Hdf5TriggerColumns columns;
  RIGCAL_ASSIGN_OR_RETURN(columns.p, Hdf5Column::Create(dataset, "p"));
  RIGCAL_ASSIGN_OR_RETURN(columns.t, Hdf5Column::Create(dataset, "t"));
  RIGCAL_ASSIGN_OR_RETURN(columns.id, Hdf5Column::Create(dataset, "id"));
  RIGCAL_RETURN_IF_ERROR(columns.p.RequireWhole());
  RIGCAL_RETURN_IF_ERROR(columns.id.RequireWhole());
  const std::string before = "/EXT_TRIGGER/cd_events_before";
  if (ObjectType(file, before) == H5I_DATASET) {
    RIGCAL_ASSIGN_OR_RETURN(const auto counts, Hdf5Dataset::Open(path, file, before));
    RIGCAL_ASSIGN_OR_RETURN(columns.events_before, Hdf5Column::Create(counts, ""));
    if (counts->row_count != dataset->row_count) columns.events_before.reset();
  }
  return columns;
}

// Of DSEC: added to every time of the file.
absl::StatusOr<int64_t> ReadTimeOffset(const std::string& path, hid_t file) {
  for (const char* const name : {"/t_offset", "/events/t_offset"}) {
    if (ObjectType(file, name) != H5I_DATASET) continue;
    const Hdf5Handle dataset(H5Dopen2(file, name, H5P_DEFAULT), H5Dclose);
    const Hdf5Handle space(H5Dget_space(dataset.get()), H5Sclose);
    const Hdf5Handle type(H5Dget_type(dataset.get()), H5Tclose);
    long long offset_us = 0;
    if (H5Sget_simple_extent_npoints(space.get()) == 1 && H5Tget_class(type.get()) == H5T_INTEGER &&
        H5Dread(dataset.get(), H5T_NATIVE_LLONG, H5S_ALL, H5S_ALL, H5P_DEFAULT, &offset_us) >= 0 &&
        std::abs(static_cast<double>(offset_us)) < kMaxOffsetUs) {
      return offset_us;
    }
    return InvalidFile(path, ": ", name, " is not one whole number of microseconds");
  }
  return 0;
}

std::optional<SensorGeometry> GeometryOf(hid_t object) {
  if (const auto text = Hdf5AttributeText(object, "geometry")) {
    const std::vector<std::string> sides = absl::StrSplit(*text, absl::ByAnyChar("x, "));
    if (sides.size() >= 2) return ParseSensorGeometry(sides.front(), sides.back());
  }
  const auto width = Hdf5AttributeText(object, "width");
  const auto height = Hdf5AttributeText(object, "height");
  if (width && height) return ParseSensorGeometry(*width, *height);
  if (const auto text = Hdf5AttributeText(object, "sensor_resolution")) {
    // Some write the height first, some the width; sensors are wider than high.
    const std::vector<std::string> sides = absl::StrSplit(*text, ' ');
    if (sides.size() < 2) return std::nullopt;
    auto geometry = ParseSensorGeometry(sides[0], sides[1]);
    if (geometry && geometry->width < geometry->height) {
      std::swap(geometry->width, geometry->height);
    }
    return geometry;
  }
  return std::nullopt;
}

herr_t TakeField(hid_t object, const char* name, const H5A_info_t*, void* fields) {
  auto* const map = static_cast<std::map<std::string, std::string>*>(fields);
  if (const auto text = Hdf5AttributeText(object, name)) (*map)[name] = *text;
  return map->size() < 64 ? 0 : 1;
}

}  // namespace

absl::StatusOr<Hdf5Layout> Hdf5Layout::Open(const std::string& path, hid_t file) {
  Hdf5Layout layout;
  layout.header.format_name = "HDF5";
  std::string& name = layout.header.layout;
  if (ObjectType(file, "/CD/events") == H5I_DATASET) {
    name = "/CD/events";
    RIGCAL_ASSIGN_OR_RETURN(layout.events, OpenCompound(path, file, name));
  } else if (ObjectType(file, "/events") == H5I_DATASET) {
    name = "/events";
    RIGCAL_ASSIGN_OR_RETURN(layout.events, OpenCompound(path, file, name));
  } else if (ObjectType(file, "/events") == H5I_GROUP) {
    name = "/events/{x,y,p,t}";
    RIGCAL_ASSIGN_OR_RETURN(layout.events, OpenGroup(path, file));
    RIGCAL_ASSIGN_OR_RETURN(layout.time_offset_us, ReadTimeOffset(path, file));
  } else {
    return InvalidFile(path, ": neither /CD/events nor /events is there, so where are its events? ",
                       "It holds ", WhatIsThere(file));
  }
  for (const Hdf5Column* column : {&layout.events.x, &layout.events.y, &layout.events.p}) {
    RIGCAL_RETURN_IF_ERROR(column->RequireWhole());
  }
  RIGCAL_ASSIGN_OR_RETURN(layout.triggers, OpenTriggers(path, file));
  for (const std::string group : {"/", "/CD", "/events"}) {
    if (group != "/" && !LinkExists(file, group)) continue;
    const Hdf5Handle object(H5Oopen(file, group.c_str(), H5P_DEFAULT), H5Oclose);
    if (object.ok() && !layout.header.geometry) layout.header.geometry = GeometryOf(object.get());
  }
  hsize_t position = 0;
  H5Aiterate2(file, H5_INDEX_NAME, H5_ITER_INC, &position, TakeField, &layout.header.fields);
  if (layout.time_offset_us != 0) {
    layout.header.fields["t_offset"] = absl::StrCat(layout.time_offset_us);
  }
  return layout;
}

}  // namespace rigcal::agent
