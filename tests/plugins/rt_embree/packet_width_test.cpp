// SPDX-License-Identifier: Apache-2.0
//
// Checks that results do not depend on the width of Embree's ray packets, which differs between processors.
#include "embree.hpp"
#include "embree_scene.hpp"

#include <gtest/gtest.h>

#include <limits>

using namespace rt_embree;

namespace {

// Every third ray is invalid: it is filled with NaN, and the intersection functions must ignore it.
bool is_valid(int lane) {
    return lane % 3 != 1;
}

class PacketWidth : public testing::TestWithParam<int> {
protected:
    PacketWidth() : device_(rtcNewDevice("threads=1")), scene_(rtcNewScene(device_.get())) {
        // The scene is a triangle that the rays with x < 8 hit.
        const GeometryHandle triangle(rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_TRIANGLE));
        auto *vertices = static_cast<float *>(rtcSetNewGeometryBuffer(triangle.get(), RTC_BUFFER_TYPE_VERTEX, 0,
                                                                      RTC_FORMAT_FLOAT3, 3 * sizeof(float), 3));
        const float corners[] = {7.5f, -100, -5, 7.5f, 100, -5, -100, 0, -5};
        std::copy_n(corners, 9, vertices);
        auto *indices = static_cast<unsigned *>(rtcSetNewGeometryBuffer(triangle.get(), RTC_BUFFER_TYPE_INDEX, 0,
                                                                        RTC_FORMAT_UINT3, 3 * sizeof(unsigned), 1));
        for (unsigned i = 0; i < 3; ++i)
            indices[i] = i;
        rtcCommitGeometry(triangle.get());
        rtcAttachGeometry(scene_.get(), triangle.get());
        rtcCommitScene(scene_.get());

        const float nan = std::numeric_limits<float>::quiet_NaN();
        for (int i = 0; i < 16; ++i) {
            valid_[i] = is_valid(i) ? -1 : 0;
            RTCRay16 &ray = rays_.ray;
            ray.org_x[i] = is_valid(i) ? static_cast<float>(i) : nan;
            ray.org_y[i] = ray.org_z[i] = ray.tnear[i] = ray.dir_x[i] = ray.dir_y[i] = ray.time[i] = 0;
            ray.dir_z[i] = is_valid(i) ? -1 : nan;
            ray.tfar[i] = std::numeric_limits<float>::infinity();
            ray.mask[i] = ~0u;
            ray.flags[i] = 0;
            rays_.hit.geomID[i] = rays_.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
        }
    }
    bool is_native() const { return GetParam() <= native_packet_width(device_.get()); }

    DeviceHandle device_;
    SceneHandle scene_;
    alignas(64) int valid_[16];
    RTCRayHit16 rays_;
};

} // namespace

TEST_P(PacketWidth, DoesNotChangeHits) {
    if (!is_native())
        GTEST_SKIP() << "this processor does not support packets of " << GetParam();
    Query query = make_query(Coherence::coherent);
    intersect16(valid_, scene_.get(), GetParam(), query, rays_);
    for (int i = 0; i < 16; ++i) {
        const bool hit = is_valid(i) && i < 8;
        EXPECT_EQ(rays_.hit.geomID[i], hit ? 0 : RTC_INVALID_GEOMETRY_ID) << "ray " << i;
        EXPECT_EQ(rays_.ray.tfar[i], hit ? 5 : std::numeric_limits<float>::infinity()) << "ray " << i;
    }
}

TEST_P(PacketWidth, DoesNotChangeOcclusion) {
    if (!is_native())
        GTEST_SKIP() << "this processor does not support packets of " << GetParam();
    Query query = make_query(Coherence::incoherent);
    occluded16(valid_, scene_.get(), GetParam(), query, rays_.ray);
    for (int i = 0; i < 16; ++i)
        EXPECT_EQ(rays_.ray.tfar[i] < 0, is_valid(i) && i < 8) << "ray " << i;
}

INSTANTIATE_TEST_SUITE_P(Widths, PacketWidth, testing::Values(4, 8, 16));
