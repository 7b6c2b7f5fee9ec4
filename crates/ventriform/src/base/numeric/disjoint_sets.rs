//! Disjoint sets (union-find), for connected components.
//!
//! The sets are a forest, stored as the parent of each element; a root is its own parent and
//! stands for its set. Searching for a root shortens the path to it (path halving; Tarjan and van
//! Leeuwen 1984). A caller that keeps data for each set may attach roots itself, to decide which
//! of them remains.

/// `count` sets of one element each.
pub fn singletons(count: usize) -> Vec<u32> {
    (0..count as u32).collect()
}

/// The root of the set that contains `element`.
pub fn root(parent: &mut [u32], mut element: u32) -> u32 {
    while parent[element as usize] != element {
        parent[element as usize] = parent[parent[element as usize] as usize];
        element = parent[element as usize];
    }
    element
}

/// Unites the sets of two elements. The lower of their roots remains a root.
pub fn unite(parent: &mut [u32], a: u32, b: u32) {
    let (a, b) = (root(parent, a), root(parent, b));
    parent[a.max(b) as usize] = a.min(b);
}

/// The number of the set of every element. Sets are numbered in the order of their first elements.
pub fn set_numbers(parent: &mut [u32]) -> Vec<u32> {
    let mut number = vec![u32::MAX; parent.len()];
    let mut count = 0;
    (0..parent.len() as u32)
        .map(|element| {
            let root = root(parent, element) as usize;
            if number[root] == u32::MAX {
                number[root] = count;
                count += 1;
            }
            number[root]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_are_numbered_by_their_first_elements() {
        let mut parent = singletons(7);
        for [a, b] in [[5, 1], [6, 5], [3, 4], [4, 3]] {
            unite(&mut parent, a, b);
        }
        assert_eq!(set_numbers(&mut parent), [0, 1, 2, 3, 3, 1, 1]);
        assert_eq!(root(&mut parent, 6), 1);
    }
}
