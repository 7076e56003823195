set(headers aligned_buffer.hpp highway_kernels.hpp kernels.hpp scalar_kernels.hpp)
