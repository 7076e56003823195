set(headers aligned_buffer.hpp highway_column_kernels.hpp highway_double_kernels.hpp highway_kernels.hpp kernels.hpp scalar_kernels.hpp)
