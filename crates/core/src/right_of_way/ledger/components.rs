//! Strongly connected components.

/// Components of a directed graph (Tarjan), those first from which nothing leads on. Nodes are visited in ascending order,
/// so are their edges as given.
pub(super) fn components(edges: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let n = edges.len();
    let (mut index, mut low, mut on) = (vec![usize::MAX; n], vec![0; n], vec![false; n]);
    let (mut stack, mut found, mut next) = (Vec::new(), Vec::new(), 0);
    // Nodes and the numbers of their edges that have been followed.
    let mut path: Vec<(usize, usize)> = Vec::new();
    for root in 0..n {
        if index[root] != usize::MAX {
            continue;
        }
        path.push((root, 0));
        while let Some(&mut (node, ref mut followed)) = path.last_mut() {
            if *followed == 0 && index[node] == usize::MAX {
                (index[node], low[node]) = (next, next);
                next += 1;
                stack.push(node);
                on[node] = true;
            }
            if let Some(&to) = edges[node].get(*followed) {
                *followed += 1;
                if index[to] == usize::MAX {
                    path.push((to, 0));
                } else if on[to] {
                    low[node] = low[node].min(index[to]);
                }
                continue;
            }
            path.pop();
            if let Some(&(before, _)) = path.last() {
                low[before] = low[before].min(low[node]);
            }
            if low[node] == index[node] {
                let from = stack.iter().rposition(|one| *one == node).expect("it is on the stack");
                let component = stack.split_off(from);
                component.iter().for_each(|one| on[*one] = false);
                found.push(component);
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::components;

    #[test]
    fn circles_are_components_and_what_they_wait_for_comes_first() {
        let sorted = |edges: &[Vec<usize>]| {
            let mut found = components(edges);
            found.iter_mut().for_each(|component| component.sort_unstable());
            found
        };
        assert_eq!(sorted(&[vec![1], vec![], vec![0]]), [vec![1], vec![0], vec![2]]);
        assert_eq!(sorted(&[vec![1], vec![2], vec![0], vec![0]]), [vec![0, 1, 2], vec![3]]);
        assert_eq!(sorted(&[vec![1, 2], vec![0], vec![3], vec![2]]), [vec![2, 3], vec![0, 1]]);
        assert_eq!(sorted(&[]), Vec::<Vec<usize>>::new());
    }
}
