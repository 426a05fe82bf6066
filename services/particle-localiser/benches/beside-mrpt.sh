#!/usr/bin/env bash
# The localiser and the mapper beside MRPT, in turns in one go: services/particle-localiser/benches/beside-mrpt.sh
# Needs from Debian: g++ libmrpt-maps-dev libmrpt-obs-dev. The same rooms, cells of 5 cm; processor time, medians.
set -euo pipefail
cd "$(dirname "$0")/../../.."
if ! ls /usr/include/mrpt/maps >/dev/null 2>&1; then
    echo "MRPT is not installed: apt-get install g++ libmrpt-maps-dev libmrpt-obs-dev" >&2
    exit 1
fi
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cat > "$folder/mrpt.cpp" <<'CPP'
// The likelihood of scans, and scans drawn into a map, by MRPT. The rooms are those of benches/update.rs.
#include <mrpt/maps/COccupancyGridMap2D.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/poses/CPose3D.h>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <functional>
#include <vector>

using mrpt::maps::COccupancyGridMap2D;
using mrpt::obs::CObservation2DRangeScan;
using mrpt::poses::CPose2D;
using mrpt::poses::CPose3D;

static double cpu_ms() {
    timespec time;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return time.tv_sec * 1e3 + time.tv_nsec * 1e-6;
}

static double median_ms(int rounds, const std::function<void()>& work) {
    std::vector<double> times;
    for (int round = 0; round < rounds; round++) {
        const double begin = cpu_ms();
        work();
        times.push_back(cpu_ms() - begin);
    }
    std::sort(times.begin(), times.end());
    return times[times.size() / 2];
}

static double modulo(double value, double by) { return value - by * std::floor(value / by); }

int main() {
    const double side = 30.0, cell = 0.05;
    COccupancyGridMap2D map(0, side, 0, side, cell);
    for (int row = 0; row < 600; row++)
        for (int column = 0; column < 600; column++) {
            const double x = (column + 0.5) * cell, y = (row + 0.5) * cell;
            const bool edge = x < 0.1 || y < 0.1 || x > side - 0.1 || y > side - 0.1;
            const bool door_x = std::abs(modulo(y, 5) - 2) < 0.5, door_y = std::abs(modulo(x, 6) - 4) < 0.5;
            const bool wall = (modulo(x, 6) < 0.1 && !door_x) || (modulo(y, 5) < 0.1 && !door_y);
            const bool pillar = std::hypot(modulo(x, 7.3) - 3.1, modulo(y, 6.1) - 3.9) < 0.2;
            map.setCell(column, row, edge || wall || pillar ? 0.0f : 1.0f);
        }
    auto& options = map.likelihoodOptions;
    options.likelihoodMethod = COccupancyGridMap2D::lmLikelihoodField_Thrun;
    options.LF_decimation = 1;
    options.LF_maxRange = 12;
    options.LF_stdHit = 0.1f;
    options.LF_maxCorrsDistance = 0.5f;
    options.enableLikelihoodCache = true;
    const double pose[3] = {15.5, 7.0, 2.0};
    const int sizes[3][2] = {{500, 60}, {2000, 60}, {10000, 180}};
    for (const auto& size : sizes) {
        CObservation2DRangeScan scan;
        scan.aperture = 1.5 * M_PI;
        scan.rightToLeft = true;
        scan.maxRange = 12;
        map.laserScanSimulator(scan, CPose2D(pose[0], pose[1], pose[2]), 0.5f, size[1], 0.01f, 1, 0);
        double sum = 0;
        const double ms = median_ms(11, [&] {
            for (int index = 0; index < size[0]; index++)
                sum += map.computeObservationLikelihood(
                    scan, CPose3D(pose[0] + 0.2 * std::sin(index * 1.1), pose[1] + 0.2 * std::cos(index * 1.7), 0,
                                  pose[2] + 0.1 * std::sin(index * 0.37), 0, 0));
        });
        std::printf("MRPT likelihood field   %6d x %3d   %8.3f ms%s\n", size[0], size[1], ms, sum == 42 ? "!" : "");
    }
    COccupancyGridMap2D drawn(0, side, 0, side, cell);
    drawn.insertionOptions.maxDistanceInsertion = 12;
    std::vector<CObservation2DRangeScan> scans(50);
    for (int index = 0; index < 50; index++) {
        scans[index].aperture = M_PI;
        scans[index].rightToLeft = true;
        scans[index].maxRange = 12;
        map.laserScanSimulator(scans[index], CPose2D(2.0 + 0.05 * index, 2.5, 0.02 * index), 0.5f, 180, 0.01f, 1, 0);
    }
    const double ms = median_ms(11, [&] {
        for (int index = 0; index < 50; index++)
            drawn.insertObservation(scans[index], CPose3D(2.0 + 0.05 * index, 2.5, 0, 0.02 * index, 0, 0));
    });
    std::printf("MRPT occupancy grid     %6.1f M rays/s (180 beams a scan)\n", 50 * 180 / ms / 1e3);
}
CPP
includes=$(printf -- '-I%s ' /usr/include/mrpt/*/include)
# shellcheck disable=SC2086 -- a list of arguments
g++ -O3 -march=native -std=c++17 $includes -I/usr/include/eigen3 "$folder/mrpt.cpp" -o "$folder/mrpt" \
    -lmrpt-maps -lmrpt-obs -lmrpt-poses -lmrpt-math -lmrpt-serialization -lmrpt-rtti -lmrpt-system -lmrpt-containers -lmrpt-core
cargo build --release --benches -p particle-localiser -p mapper
for round in 1 2; do
    echo "== round $round"
    "$folder/mrpt"
    cargo bench --quiet -p particle-localiser --bench update
    cargo bench --quiet -p mapper
done
