# SPDX-License-Identifier: Apache-2.0
# All external libraries, packages of Debian 12 or 13 that deploy/install-deps.sh installs, and what differs between
# the two.
find_package(Threads REQUIRED)
find_package(absl CONFIG REQUIRED)
find_package(Protobuf REQUIRED) # module mode: Debian ships no CONFIG package for 3.21
find_package(gRPC CONFIG REQUIRED)
find_package(Eigen3 CONFIG REQUIRED)
find_package(Ceres CONFIG REQUIRED)
find_package(OpenCV CONFIG REQUIRED COMPONENTS core calib3d imgproc imgcodecs videoio features2d aruco video)
find_package(spdlog CONFIG REQUIRED)
find_package(tomlplusplus CONFIG REQUIRED)
find_package(yaml-cpp CONFIG REQUIRED)
find_package(SQLiteCpp CONFIG REQUIRED)
find_package(OpenSSL 3.0 REQUIRED)
if(POLICY CMP0167)
  cmake_policy(SET CMP0167 NEW) # CMake 3.30 wants Boost's own configuration; both have it
endif()
find_package(Boost REQUIRED CONFIG) # headers only: Asio and Beast
find_package(ZLIB REQUIRED)
find_package(LibArchive REQUIRED)
find_package(prometheus-cpp CONFIG REQUIRED COMPONENTS core) # text format only
find_package(PkgConfig REQUIRED)
pkg_check_modules(SQLITE3 REQUIRED IMPORTED_TARGET sqlite3)
pkg_check_modules(LIBPQ REQUIRED IMPORTED_TARGET libpq)
pkg_check_modules(LIBXML2 REQUIRED IMPORTED_TARGET libxml-2.0)
pkg_check_modules(ARAVIS REQUIRED IMPORTED_TARGET aravis-0.8)
pkg_check_modules(HDF5 REQUIRED IMPORTED_TARGET hdf5)
pkg_check_modules(SYSTEMD REQUIRED IMPORTED_TARGET libsystemd)
pkg_check_modules(AVAHI IMPORTED_TARGET avahi-client) # optional: common/discovery
if(NOT AVAHI_FOUND)
  message(STATUS "Servers are not found by mDNS: libavahi-client-dev is not installed")
endif()
find_package(nlohmann_json REQUIRED)
find_package(CLI11 REQUIRED)

option(RIGCAL_METAVISION "Support live event cameras through OpenEB or the Metavision SDK (4.1 to 5.x; not in Debian)" OFF)
if(RIGCAL_METAVISION)
  find_package(MetavisionHAL CONFIG QUIET)
  if(NOT MetavisionHAL_FOUND)
    message(FATAL_ERROR "RIGCAL_METAVISION is ON, but MetavisionHAL was not found. Install OpenEB or the Metavision SDK "
      "(4.1 to 5.x) and pass its prefix with -DCMAKE_PREFIX_PATH=PREFIX, or switch RIGCAL_METAVISION off: recordings "
      "of event cameras do not need it.")
  elseif(MetavisionHAL_VERSION VERSION_LESS 4.1)
    message(FATAL_ERROR "RIGCAL_METAVISION needs MetavisionHAL 4.1 to 5.x; found ${MetavisionHAL_VERSION}")
  endif()
endif()

if(RIGCAL_BUILD_TESTS OR NOT DEFINED RIGCAL_BUILD_TESTS)
  find_package(GTest CONFIG REQUIRED)
  find_package(rapidcheck CONFIG REQUIRED)
  find_package(benchmark CONFIG REQUIRED)
endif()
